"""The shortest trip that verifies joints by their switches: passed where a motion can pass them, homed where not."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from gemelo.api.errors import Refused
from gemelo.api.ledger import Ledger
from gemelo.api.moving_arm import MovingArm
from gemelo.api.planning import Plan
from gemelo.api.targets import require_joint
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.ledger import VerifiedBy
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.robot import HomingDirection

OVERSHOOT = {"rad": 0.02, "m": 0.002}  # chosen: beyond the switch, where the limits leave as much
LEAST_STEPS = 3.0  # beyond the switch: closer to it the limit may come first

OnVerifying = Callable[[Reason], object]


@dataclass(frozen=True)
class Verification:
    """How joints were verified.

    >>> found = arm.verify("efector_joint")
    >>> found.homed, found.passed, found.without_switch
    (('efector_joint',), (), ())
    """

    passed: tuple[str, ...]  # by their switches, in a motion: nothing was homed anew
    homed: tuple[str, ...]
    without_switch: tuple[str, ...]  # these only a person can verify: arm.reference(...)
    steps_off: dict[str, int]  # of joints whose place had been known before
    took: float  # [s]


@dataclass
class Trip:
    """What is still to be done."""

    passable: list[Joint] = field(default_factory=list)
    homing: list[str] = field(default_factory=list)
    without_switch: list[str] = field(default_factory=list)


def verify(
    arm: MovingArm, names: Iterable[str], run: Callable[[Plan], object], tell: OnVerifying | None
) -> Verification:
    """Verifies the joints named, or all; `run` goes along a plan. Raises what `Arm.move` and `Arm.home` raise."""
    say = tell if tell is not None else _silent
    began = arm.node.monotonic()
    trip = trip_of(arm.description, names, arm.device.state.referenced, arm.joints)
    passed = _pass(arm, trip, run, say)
    off = {name: arm.ledger.joints[name].found_off for name in passed}
    trip.homing += [joint.name for joint in trip.passable if joint.name not in passed]
    if trip.homing:
        say(because("verify.homing", joints=", ".join(trip.homing)))
        off |= arm.home(*trip.homing).steps_off
    return Verification(
        passed=tuple(passed),
        homed=tuple(trip.homing),
        without_switch=tuple(trip.without_switch),
        steps_off=off,
        took=arm.node.monotonic() - began,
    )


def trip_of(arm: ArmDescription, names: Iterable[str], referenced: Sequence[bool], at: Mapping[str, float]) -> Trip:
    """How each joint can be verified from `at` [rad] or [m]; raises `BadArgument`, or `Refused` where none can."""
    trip, known = Trip(), dict(zip(arm.joint_names, referenced, strict=False))
    for name in tuple(names) or arm.joint_names:
        require_joint(arm, name)
        joint = arm.joint(name)
        if joint.drive.homing is None:
            trip.without_switch.append(name)
        elif is_passable(arm, joint) and known.get(name) and joint.is_within(at[name]):
            trip.passable.append(joint)
        else:
            trip.homing.append(name)
    if not trip.passable and not trip.homing:
        raise Refused(
            because("verify.no_switch", remedy("look_and_declare"), joints=", ".join(trip.without_switch)),
            check="verify",
            subject=trip.without_switch[0],
            remedy="arm.reference({...})",
        )
    return trip


def is_passable(arm: ArmDescription, joint: Joint) -> bool:
    """True if a motion may close the joint's switch: one that is no limit switch, within the joint's limits."""
    homing = joint.drive.homing
    if homing is None:
        return False
    role = next((each.role for each in arm.inputs if each.name == homing.switch), None)
    return role is InputRole.HOME and _beyond(joint) >= LEAST_STEPS * joint.steps.resolution


def far_side(joint: Joint, at: float) -> tuple[float, float]:
    """Where [rad] or [m] to go so that the switch is passed, on the way there or back: first there, then here.

    From before the switch a little beyond it and back; from beyond it before it, and then beyond it.
    """
    homing = joint.drive.homing
    assert homing is not None
    sign = 1.0 if homing.direction is HomingDirection.UPPER else -1.0
    beyond = homing.position + sign * _beyond(joint)
    before = joint.clamp(homing.position - sign * homing.back_off)
    return (beyond, at) if sign * (homing.position - at) > 0.0 else (before, beyond)


def _beyond(joint: Joint) -> float:
    """[rad] or [m] that a motion may go on behind the switch."""
    homing = joint.drive.homing
    if homing is None:
        return 0.0
    is_upper = homing.direction is HomingDirection.UPPER
    room = joint.upper - homing.position if is_upper else homing.position - joint.lower
    return min(OVERSHOOT[joint.unit], 0.5 * room)


def _pass(arm: MovingArm, trip: Trip, run: Callable[[Plan], object], say: OnVerifying) -> list[str]:
    """The joints whose switches were passed: all in one motion if that is free, else one by one."""
    if not trip.passable:
        return []
    try:
        return _pass_together(arm, trip.passable, run, say)
    except Refused:
        if len(trip.passable) == 1:
            return []
    found: list[str] = []
    for joint in trip.passable:
        try:
            found += _pass_together(arm, [joint], run, say)
        except Refused as refused:
            say(because("verify.cannot_pass", refused.message, joint=joint.name))
    return found


def _pass_together(
    arm: MovingArm, joints: Sequence[Joint], run: Callable[[Plan], object], say: OnVerifying
) -> list[str]:
    """Both ways are planned before anything moves."""
    at, before = arm.joints, arm.ledger
    ends = {joint.name: far_side(joint, at[joint.name]) for joint in joints}
    there = arm.plan(joints={name: end[0] for name, end in ends.items()})
    back = arm.plan(joints={name: end[1] for name, end in ends.items()}, from_joints=there.end)
    say(because("verify.passing", joints=", ".join(ends)))
    run(there)
    run(back)
    return [joint.name for joint in joints if _was_passed(before, arm.ledger, joint.name)]


def _was_passed(before: Ledger, now: Ledger, name: str) -> bool:
    """True if the joint's switch has verified it in between and found no step lost; else it needs a homing."""
    old, new = before.joints[name], now.joints[name]
    is_seen = new.verified_by is VerifiedBy.SWITCH and new.verified_at > old.verified_at
    return is_seen and new.confidence > 0.0


def _silent(_what: Reason) -> None:
    """For nobody."""
