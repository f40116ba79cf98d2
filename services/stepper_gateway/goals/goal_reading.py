"""Goals as they come: a long one is decoded in pieces."""

from __future__ import annotations

import msgspec
from msgspec.structs import replace

from gemelo.schemas.message import decode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, TrajectoryPoint
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Pieces

LONG = 64 * 1024  # [bytes] chosen: some 500 points, which take a millisecond

_fields = msgspec.msgpack.Decoder(dict[str, msgspec.Raw])
_list = msgspec.msgpack.Decoder(list[msgspec.Raw])
_point = msgspec.msgpack.Decoder(TrajectoryPoint)


def read_goal(payload: bytes) -> Pieces[FollowJointTrajectoryGoal]:
    """The goal in `payload`; raises `BadMessage`."""
    if len(payload) < LONG:
        return decode(FollowJointTrajectoryGoal, payload)
    try:
        fields = _fields.decode(payload)
        trajectory = _fields.decode(fields["trajectory"])
        coming = _list.decode(trajectory.pop("points"))
        rest = msgspec.msgpack.encode({**fields, "trajectory": trajectory})
        goal = decode(FollowJointTrajectoryGoal, rest)
        points: list[TrajectoryPoint] = []
        for begin in range(0, len(coming), PIECE):
            points += map(_point.decode, coming[begin : begin + PIECE])
            yield
        return replace(goal, trajectory=replace(goal.trajectory, points=tuple(points)))
    except (msgspec.DecodeError, ValueError, LookupError):
        return decode(FollowJointTrajectoryGoal, payload)  # which says what is wrong, and where
