"""The start of a plan: the request's start state, completed by the present state, and checked."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gemelo.libraries.arm.model.description import ROUNDING, ArmDescription, Joint
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanCode
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.request.per_arm import once_per_arm
from gemelo.services.planner.request.refusals import (
    malformed,
    moving_start,
    stale_state,
    start_beyond_limit,
    unknown_name,
)

# Tuning constants: chosen, where a line does not say measured or standard.
STALE_AFTER = 0.5  # [s] without a joint state; standard: as long as the device waits for a heartbeat
REST = 0.01  # share of a joint's velocity limit below which it stands
MOST_TURNED = 90.0  # [rad] of a joint without limits: the native planner takes 100, and a search goes half a turn more
HALF_STEP = 0.51  # [steps] executed positions are whole steps, so they may be this far beyond a limit


def resolve_start(
    arm: ArmDescription, given: JointState | None, present: JointState | None, age: float
) -> tuple[float, ...]:
    """Joint values [rad] or [m] in the arm's order, within the limits; raises `PlanRefused`."""
    told = present if given is None and age <= STALE_AFTER else given
    if told is not None and told.name == arm.joint_names and not any(told.velocity) and are_usable(arm, told.position):
        return told.position
    values = {} if given is None else _values(arm, given)
    if len(values) < len(arm.joints):
        values = {**_present(arm, present, age), **values}
    for joint in arm.joints:
        value = values[joint.name]
        require_unwound(PlanCode.INVALID_ROBOT_STATE, joint, value)
        if abs(value - joint.clamp(value)) > max(ROUNDING, HALF_STEP * joint.steps.resolution):
            raise start_beyond_limit(joint, value)
    return tuple(joint.clamp(values[joint.name]) for joint in arm.joints)


def _present(arm: ArmDescription, present: JointState | None, age: float) -> dict[str, float]:
    if present is None:
        raise stale_state(None, STALE_AFTER)
    if age > STALE_AFTER:
        raise stale_state(age, STALE_AFTER)
    values = _values(arm, present)
    missing = [name for name in arm.joint_names if name not in values]
    if missing:
        would_do = remedy("whole_start"), remedy("see_joint_states")
        why = because("plan.state.incomplete", *would_do, joints=tuple(missing))
        raise malformed(PlanCode.INVALID_ROBOT_STATE, missing[0], why, check="joint state")
    return values


def _values(arm: ArmDescription, state: JointState) -> dict[str, float]:
    """The positions by name; the joints must stand."""
    require_parallel(state.name, state.position, "start_state")
    for name in state.name:
        if name not in arm.joint_names:
            raise unknown_name(PlanCode.INVALID_ROBOT_STATE, "unknown joint", name, arm.joint_names, arm.name)
    for name, velocity in zip(state.name, state.velocity, strict=False):
        joint = arm.joint(name)
        if abs(velocity) > REST * joint.velocity:
            raise moving_start(joint, velocity, REST * joint.velocity)
    return dict(zip(state.name, state.position, strict=True))


def are_usable(arm: ArmDescription, positions: Sequence[float]) -> bool:
    """True if there is a value [rad] or [m] for each joint, in the arm's order, and all are where a plan may begin or
    end: an answer in a tenth of the time that it takes to say why not."""
    spans = _spans(arm)
    return len(positions) == len(spans) and all(
        lower <= value <= upper for value, (lower, upper) in zip(positions, spans, strict=True)
    )


@once_per_arm
def _spans(arm: ArmDescription) -> list[tuple[float, float]]:
    """The limits of each joint [rad] or [m], and `MOST_TURNED` where it has none."""
    endless = (-MOST_TURNED, MOST_TURNED)
    return [endless if math.isinf(joint.upper) else (joint.lower, joint.upper) for joint in arm.joints]


def require_unwound(code: PlanCode, joint: Joint, value: float) -> None:
    """Raises `PlanRefused` if the joint has no limits and `value` [rad] is more than `MOST_TURNED` from 0."""
    if math.isinf(joint.upper) and abs(value) > MOST_TURNED:
        would_do = remedy("count_from_here"), remedy("fewer_turns")
        why = because("plan.limit.turns", *would_do, joint=joint.name, value=value, limit=MOST_TURNED)
        raise malformed(code, joint.name, why, check="joint limit")


def require_parallel(names: Sequence[str], positions: Sequence[float], where: str) -> None:
    """Raises `PlanRefused` unless there is one position [rad] or [m] for every name, and no name twice.

    `where` is a word of the catalogue.
    """
    if len(names) != len(positions):
        counts = {"names": len(names), "positions": len(positions)}
        why = because("plan.names.count", remedy("one_position_each"), where=where, **counts)
        raise malformed(PlanCode.INVALID_GOAL_CONSTRAINTS, where, why)
    for name in names:
        if names.count(name) > 1:
            why = because("plan.names.twice", remedy("name_once"), where=where, joint=name)
            raise malformed(PlanCode.INVALID_GOAL_CONSTRAINTS, name, why)
