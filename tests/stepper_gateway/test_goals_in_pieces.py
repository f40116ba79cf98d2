"""A long goal is read and checked in pieces, and the verdict is that of one look; counted in calls, not in time."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest
from msgspec.structs import replace

from gemelo.schemas.message import BadMessage, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.goals.goal_reading import read_goal
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Pieces
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.test_gateway_long_goals import wave

POINTS = 20_000
LONG = 900.0  # [s]
MOST_CALLS = 60 * PIECE  # of Python functions in one piece; some ten milliseconds
FORMS = {"cubic": True, "linear": False}


class Calls:
    """How many Python functions have been called."""

    def __init__(self) -> None:
        self.count = 0

    @contextmanager
    def counted(self) -> Iterator[None]:
        def on_event(_frame: FrameType, event: str, _argument: object) -> None:
            self.count += event == "call"

        before = sys.getprofile()
        self.count = 0
        sys.setprofile(on_event)
        try:
            yield
        finally:
            sys.setprofile(before)


def most_in_a_piece(pieces: Pieces[object]) -> tuple[int, int, object]:
    """The most calls in one piece, the number of pieces, and what comes of them."""
    calls, most, number = Calls(), 0, 0
    while True:
        number += 1
        with calls.counted():
            try:
                next(pieces)
            except StopIteration as ended:
                return max(most, calls.count), number, ended.value
        most = max(most, calls.count)


def prepared(arm: VirtualArm, goal: FollowJointTrajectoryGoal) -> Pieces[None]:
    yield from arm.core.prepare_goal(goal, arm.moment)


@pytest.mark.parametrize("with_velocities", FORMS.values(), ids=FORMS)
@pytest.mark.parametrize("order", [1, -1], ids=["ordered", "other order"])
def test_no_piece_of_a_long_goal_takes_more_than_a_few_milliseconds(with_velocities: bool, order: int) -> None:
    arm = VirtualArm().ready()
    wanted = reordered(wave(POINTS, arm, with_velocities), order)
    most, number, goal = most_in_a_piece(read_goal(encode(wanted)))
    assert goal == wanted
    assert most <= MOST_CALLS
    assert number > POINTS / PIECE
    assert isinstance(goal, FollowJointTrajectoryGoal)
    most, number, _ = most_in_a_piece(prepared(arm, goal))
    assert most <= MOST_CALLS
    assert number > 4 * POINTS / PIECE
    calls = Calls()
    with calls.counted():
        verdict = arm.goal(goal)
    assert verdict.accepted
    assert calls.count <= MOST_CALLS


def test_two_points_minutes_apart_are_checked_in_pieces_too() -> None:
    arm = VirtualArm().ready()
    goal = two_points(arm, 0.01, LONG)
    most, number, _ = most_in_a_piece(prepared(arm, goal))
    assert most <= MOST_CALLS
    assert number > LONG / 0.01 / PIECE
    calls = Calls()
    with calls.counted():
        assert arm.goal(goal).accepted
    assert calls.count <= MOST_CALLS


def two_points(arm: VirtualArm, off: float, first: float) -> FollowJointTrajectoryGoal:
    """From where the arm is, in `first` [s] to one that is `off` [rad] or [m], and 20 s later to half of that."""
    here = arm.arm.reference_position
    rows = ((*here[:-1], here[-1] + off), (*here[:-1], here[-1] + off / 2.0))
    zeros = tuple(0.0 for _ in here)
    points = tuple(
        TrajectoryPoint(positions=row, velocities=zeros, time_from_start=t)
        for row, t in zip(rows, (first, first + 20.0), strict=True)
    )
    return FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=arm.arm.joint_names, points=points))


def reordered(goal: FollowJointTrajectoryGoal, order: int) -> FollowJointTrajectoryGoal:
    """The same with its joints in the opposite order where `order` is -1."""
    points = tuple(
        replace(point, positions=point.positions[::order], velocities=point.velocities[::order])
        for point in goal.trajectory.points
    )
    names = goal.trajectory.joint_names[::order]
    return replace(goal, trajectory=replace(goal.trajectory, joint_names=names, points=points))


def spoiled(goal: FollowJointTrajectoryGoal, index: int, **fields: object) -> FollowJointTrajectoryGoal:
    points = list(goal.trajectory.points)
    points[index] = replace(points[index], **fields)
    return replace(goal, trajectory=replace(goal.trajectory, points=tuple(points)))


FAULTS: dict[str, dict[str, object]] = {
    "beyond its limit": {"positions": (0.0, 0.0, 99.0)},
    "too far": {"positions": (0.0, 0.0, 0.3)},
    "another size": {"positions": (0.0,)},
    "back in time": {"time_from_start": 1.0},
    "a velocity alone": {"velocities": (0.0,)},
}


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("pieces", [0, 1, 3, 1000])
@pytest.mark.parametrize("with_velocities", FORMS.values(), ids=FORMS)
def test_the_verdict_is_the_same_however_far_a_goal_was_looked_at_before(
    fault: str, pieces: int, with_velocities: bool
) -> None:
    """Also where that was left halfway."""
    one, other = VirtualArm().ready(), VirtualArm().ready()
    goal = spoiled(wave(3 * PIECE, one, with_velocities), 2 * PIECE, **FAULTS[fault])
    ahead = other.core.prepare_goal(goal, other.moment)
    for _ in zip(range(pieces), ahead, strict=False):
        pass
    verdict = one.goal(goal)
    assert not verdict.accepted
    assert other.goal(goal) == verdict


def test_what_was_looked_at_for_another_place_of_the_arm_is_looked_at_again() -> None:
    """The way to the first point begins where the arm is when the goal is accepted."""
    one, other = VirtualArm().ready(), VirtualArm().ready()
    goal = two_points(one, 0.01, 30.0)
    for _ in other.core.prepare_goal(goal, other.moment):
        pass
    for arm in (one, other):
        here = arm.arm.reference_position
        near = TrajectoryPoint(positions=(*here[:-1], here[-1] + 0.02), time_from_start=5.0)
        arm.goal(JointTrajectory(joint_names=arm.arm.joint_names, points=(near,)), "near")
        arm.finish("near")
    assert one.goal(goal) == other.goal(goal)
    assert [arm.run(5.0) for arm in (one, other)]
    assert one.position == pytest.approx(other.position, abs=1e-12)


@pytest.mark.parametrize(
    "payload", [b"\xc1" * 70_000, b"\x80" + b"\x00" * 70_000, encode(FollowJointTrajectoryGoal()) + b"\x00" * 70_000]
)
def test_what_is_no_goal_is_refused_by_name(payload: bytes) -> None:
    with pytest.raises(BadMessage, match="not a FollowJointTrajectoryGoal"):
        list(read_goal(payload))


def test_a_number_in_a_long_goal_that_is_not_finite_is_refused_with_its_place() -> None:
    goal = wave(3 * PIECE, VirtualArm().ready(), False)
    payload = encode(goal).replace(encode(goal.trajectory.points[700])[-8:], b"\x7f\xf0" + b"\x00" * 6)
    with pytest.raises(BadMessage, match=r"finite - at `\$.trajectory.points\[...\]`"):
        list(read_goal(payload))
    assert math.isfinite(goal.trajectory.points[700].time_from_start)
