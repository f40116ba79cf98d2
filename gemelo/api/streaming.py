"""Streamed targets, one by one or as a policy's chunks. The arm stops by itself when no more are sent."""

from __future__ import annotations

import math
from collections.abc import Iterable

from msgspec.structs import replace

from gemelo.api.arguments import Joints, Vector
from gemelo.api.errors import BadArgument, Lost, Refused
from gemelo.api.jog import require_joint_speed
from gemelo.api.session import Session
from gemelo.api.targets import joint_state, named_joints, number, point, quaternion, require_within
from gemelo.api.units import Pose
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceEvent
from gemelo.schemas.joints import LEAST_APART, LONGEST_AHEAD, MOST_AHEAD, JointState, JointTargets, TargetAhead
from gemelo.schemas.planning import JogStatus, PoseTarget
from gemelo.schemas.reasons import Reason, because, plain, remedy
from gemelo.schemas.topics import DEVICE_EVENTS, JOG_STATUS, JOINT_STATES, JOINT_TARGETS, POSE_TARGETS

PAUSE = 0.5  # [s] without a target, after which the next one begins a new stream
OBSTRUCTED = 1.2  # [s] for which an obstruction is told; the gateway publishes one a second
ANSWER = 3.0  # [s] of poses without a status of the planner, after which it counts as lost
GAP = 1.0  # [s] without a state in the middle: the gateway publishes fifty a second


class Streaming:
    """One connection's streamed targets. The gateway follows the newest, and brakes 0.11 s after the last."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._refused: Reason | None = None  # why the gateway did not take the last target
        self._obstruction = JogStatus()  # what was in the way of joint targets
        self._obstructed = -math.inf  # [s] monotonic, when that was published
        self._status: JogStatus | None = None  # of the planner, on this stream of poses
        self._heard = -math.inf  # [s] monotonic, when that came
        self._began = self._said = -math.inf  # [s] monotonic, of this stream's first and last target

    def lead(self, pose: Pose | Vector) -> JogStatus | None:
        """The planner's newest status; raises `BadArgument`, `Refused` where the pose is out of reach or the gateway
        has refused it, or `Lost` where the planner is silent."""
        node = self._session.node
        self._session.latest(JOG_STATUS, self._on_status)
        self._prepare(0.0)
        node.publisher(POSE_TARGETS).put(replace(pose_target(pose), stamp=node.now()))
        status, now = self._status, self._session.clock.monotonic()
        if now - max(self._began, self._heard) > ANSWER:
            raise Lost(because("lost.jog.planner", remedy("list_nodes")))
        if status is None or (status.active and all(limit.check != "reach" for limit in status.limits)):
            return status
        self._status = None
        reach = next((limit.why for limit in status.limits if limit.check == "reach"), None)
        why = reach or status.why
        if why is not None:
            raise Refused(because("client.refused", why), check="stream", reason=why)
        return status

    def say(self, joints: Joints, velocity: Joints | None, ahead: Iterable[Joints], period: float) -> JogStatus | None:
        """What is in the way; as `targets_of`, with a `period` [s]. Raises `Refused` where the gateway has refused the
        target before, or `Lost` where it is silent."""
        targets = targets_of(self._session.description, joints, velocity, ahead, period)
        self._prepare(targets.ahead[-1].time if targets.ahead else 0.0)
        node = self._session.node
        node.publisher(JOINT_TARGETS).put(replace(targets, stamp=node.now()))
        return self._in_the_way()

    def _in_the_way(self) -> JogStatus | None:
        now = self._session.clock.monotonic()
        is_new = self._obstructed >= self._began and now - self._obstructed < OBSTRUCTED
        return self._obstruction if is_new else None

    def _prepare(self, lasts: float) -> None:
        """Before a target is sent that leads the arm for `lasts` [s]."""
        self._session.latest(DEVICE_EVENTS, self._on_event)
        now = self._session.clock.monotonic()
        if now - self._said > PAUSE:
            self._began, self._status = now, None
        self._said = now + lasts
        states = self._session.latest(JOINT_STATES)  # heard from the first target on
        if now - self._began > GAP and states.age() > GAP:
            raise Lost(because("lost.stream", remedy("list_nodes"), time=GAP))
        why, self._refused = self._refused, None
        if why is not None:
            raise Refused(because("client.refused", why), check="stream", reason=why)

    def _on_status(self, status: JogStatus) -> None:
        if status.client in ("", self._session.node.address):
            self._status, self._heard = status, self._session.clock.monotonic()

    def _on_event(self, event: DeviceEvent) -> None:
        """Only of the stream that runs, and not of another's: events of before may come late."""
        if event.client not in ("", self._session.node.address):
            return
        now = self._session.clock.monotonic()
        if event.event == "target_obstructed" and now - self._said < PAUSE:
            why = event.why or plain(event.detail)
            self._obstruction, self._obstructed = JogStatus(active=True, limited_by=str(why), why=why), now
        if event.event == "target_refused" and self._session.clock.monotonic() - self._said < PAUSE:
            self._refused = event.why or plain(event.detail)


def targets_of(
    arm: ArmDescription, joints: Joints, velocity: Joints | None, ahead: Iterable[Joints], period: float
) -> JointTargets:
    """One message without a stamp; raises `BadArgument` for what cannot be meant.

    `velocity` [rad/s] or [m/s] there, None to be estimated; `ahead` one target every `period` [s] after the first.
    """
    first = _state(arm, joints, "joints")
    rates: tuple[float, ...] = ()
    if velocity is not None:
        given = named_joints(arm, velocity, "velocity")
        _require_same(first.name, tuple(given), "velocity")
        rates = tuple(given[name] for name in first.name)
        for name in first.name:
            require_joint_speed(arm, name, given[name])
    rows = [_state(arm, each, f"ahead[{index}]") for index, each in enumerate(ahead)]
    if len(rows) > MOST_AHEAD:
        raise BadArgument(because("argument.stream.many", argument="ahead", count=len(rows), limit=MOST_AHEAD))
    longest = LONGEST_AHEAD / len(rows) if rows else LONGEST_AHEAD
    if rows and not LEAST_APART <= number("period", period) <= longest:
        limits = {"lower": LEAST_APART, "upper": longest}
        raise BadArgument(because("argument.stream.period", argument="period", value=period, **limits))
    points = []
    for index, row in enumerate(rows):
        _require_same(first.name, row.name, f"ahead[{index}]")
        places = dict(zip(row.name, row.position, strict=True))
        points.append(TargetAhead(time=period * (index + 1), position=tuple(places[name] for name in first.name)))
    return JointTargets(name=first.name, position=first.position, velocity=rates, ahead=tuple(points))


def pose_target(pose: Pose | Vector) -> PoseTarget:
    """The message, without a stamp, for a pose or a position (3,) [m] in the base; raises `BadArgument`."""
    if isinstance(pose, Pose):
        return PoseTarget(position=point("pose", pose.position), orientation=quaternion("pose", pose.orientation))
    return PoseTarget(position=point("pose", pose))


def _state(arm: ArmDescription, joints: Joints, owner: str) -> JointState:
    """Joint values [rad] or [m] within the limits."""
    state = joint_state(arm, joints, owner)
    require_within(arm, dict(zip(state.name, state.position, strict=True)))
    return state


def _require_same(names: tuple[str, ...], others: tuple[str, ...], owner: str) -> None:
    if set(names) != set(others):
        raise BadArgument(because("argument.stream.joints", argument=owner, given=others, joints=names))
