"""The margins at the moment of an incident: of the joint concerned, its steps, the tool and the queue. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint, urdf_of
from gemelo.libraries.recordings.channels import Entry
from gemelo.schemas.device import DeviceState
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.logger.incident_watch import STOPPED, reason_of

MOVING = 1e-3  # [rad/s] or [m/s]


def margins_of(before: Sequence[Entry], joint: str) -> Iterator[Reason]:
    """One on the joint concerned or the fastest one, and one each on steps, tool and queue."""
    newest: dict[type[Message], Any] = {}
    for entry in before:
        is_other = isinstance(entry.message, JointState) and entry.topic.key != JOINT_STATES.key
        is_after = isinstance(entry.message, DeviceState) and entry.message.mode in STOPPED
        if not is_other and not is_after:
            newest[type(entry.message)] = entry.message
    limits = _limits(newest.get(RobotDescription))
    if JointState in newest:
        yield from _of_joint(newest[JointState], limits, joint)
    if StepErrors in newest and newest[StepErrors].error:
        errors: StepErrors = newest[StepErrors]
        worst, name = max((abs(error), name) for error, name in zip(errors.error, errors.name, strict=False))
        yield because("incident.step_error", error=worst, joint=name)
    if StepLedger in newest and newest[StepLedger].name:
        yield _of_ledger(newest[StepLedger])
    if StoppingDistance in newest and newest[StoppingDistance].is_known:
        stopping: StoppingDistance = newest[StoppingDistance]
        yield because("incident.further", distance=stopping.distance, duration=stopping.duration)
    if DeviceState in newest:
        state: DeviceState = newest[DeviceState]
        yield because("incident.queue", buffered=state.buffered, round_trip=state.round_trip)


def _of_joint(state: JointState, limits: dict[str, UrdfJoint], joint: str) -> Iterator[Reason]:
    speeds = dict(zip(state.name, state.velocity, strict=False))
    values = dict(zip(state.name, state.position, strict=False))
    shares = {
        name: abs(speed) / limits[name].limit.velocity  # type: ignore[union-attr]
        for name, speed in speeds.items() if name in limits
    }  # fmt: skip
    fastest = max(shares, key=lambda name: shares[name], default="")
    chosen = joint if joint in values else fastest
    if chosen not in values or chosen not in limits:
        return
    drive = limits[chosen]
    limit = drive.limit
    assert limit is not None  # `_limits` takes no other
    value, is_moving = values[chosen], abs(speeds.get(chosen, 0.0)) > MOVING
    motion = because("incident.speed", share=shares[chosen]) if is_moving else because("incident.at_rest")
    unit = "m" if drive.kind is JointKind.PRISMATIC else "rad"
    about: dict[str, Value] = {"joint": chosen, "position": value, "unit": unit}
    if drive.kind is JointKind.CONTINUOUS:
        yield because("incident.joint", motion, **about)
    else:
        room = min(value - limit.lower, limit.upper - value)
        yield because("incident.joint.limited", motion, room=room, **about)


def _of_ledger(ledger: StepLedger) -> Reason:
    why, confidence = reason_of(ledger.reason, ledger.why), ledger.arm_confidence
    if why is not None:
        return because("incident.sure.because", why, confidence=confidence)
    if ledger.doubtful:
        return because("incident.sure.least", confidence=confidence, joint=ledger.doubtful)
    return because("incident.sure", confidence=confidence)


def _limits(description: RobotDescription | None) -> dict[str, UrdfJoint]:
    """The joints of the URDF that have a limit of speed."""
    if description is None:
        return {}
    try:
        model, _ = urdf_of(description.urdf)
    except DescriptionError:
        return {}
    return {each.name: each for each in model.joints if each.limit is not None and each.limit.velocity > 0.0}
