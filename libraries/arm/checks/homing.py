"""Checks of [joint.homing]: that the switch is there, can be found, and leaves the joint where it may work."""

from __future__ import annotations

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import DescriptionError, Subject, nearest
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfModel
from gemelo.libraries.arm.motors.speed import SpeedLimits, speed_limits
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import Homing, HomingDirection, Input, RobotFile, StepperJoint

END_OF = {InputRole.LIMIT_LOWER: HomingDirection.LOWER, InputRole.LIMIT_UPPER: HomingDirection.UPPER}


def check_homing(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Every joint that homes; what `check_motors` finds first is not said again."""
    findings: list[Finding] = []
    for drive in robot.joint:
        if drive.homing is None or drive.name not in model.joint_names:
            continue
        subject = Subject("joint", drive.name)
        findings += _switch(drive, drive.homing, robot, subject)
        try:
            speed = speed_limits(drive)
        except DescriptionError:
            continue
        joint = model.joint(drive.name)
        unit = "m" if joint.kind is JointKind.PRISMATIC else "rad"
        findings += _speeds(drive.homing, speed, subject, unit)
        if joint.limit is not None and joint.kind is not JointKind.CONTINUOUS:
            findings += _places(drive, drive.homing, joint.limit, speed, subject, unit)
            findings += _travel(drive.homing, joint.limit, subject, unit)
            findings += _limit_switch(drive.homing, robot, joint.limit, subject, unit)
    return findings


def _switch(drive: StepperJoint, homing: Homing, robot: RobotFile, subject: Subject) -> list[Finding]:
    switch = _input(homing, robot)
    if switch is None:
        near = nearest(homing.switch, [one.name for one in robot.input])
        return [error(ROBOT_FILE, subject, because("robot.homing.no_switch", near, switch=homing.switch))]
    if switch.joint != drive.name:
        own = remedy("own_switch")
        if switch.joint:
            what = because("robot.homing.other_joint", own, switch=switch.name, joint=switch.joint)
        else:
            what = because("robot.homing.other_role", own, switch=switch.name, role=str(switch.role))
        return [error(ROBOT_FILE, subject, what)]
    end = END_OF.get(switch.role)
    if end is not None and end is not homing.direction:
        turn = remedy("write_line", text=f'direction = "{end}"')
        direction, role = str(homing.direction), str(switch.role)
        what = because("robot.homing.other_end", turn, direction=direction, switch=switch.name, role=role)
        return [error(ROBOT_FILE, subject, what)]
    return []


def _input(homing: Homing, robot: RobotFile) -> Input | None:
    return next((one for one in robot.input if one.name == homing.switch), None)


def _speeds(homing: Homing, speed: SpeedLimits, subject: Subject, unit: str) -> list[Finding]:
    found = []
    for key, value in (("fast", homing.fast), ("slow", homing.slow)):
        if value > speed.velocity:
            slower, limit = remedy("home_slower"), speed.velocity
            found.append(because("robot.homing.too_fast", slower, key=key, value=value, limit=limit, unit=unit))
    if homing.slow > homing.fast:
        slower = remedy("slower_second")
        found.append(because("robot.homing.slow_faster", slower, slow=homing.slow, fast=homing.fast, unit=unit))
    return [error(ROBOT_FILE, subject, what) for what in found]


def _places(
    drive: StepperJoint, homing: Homing, limit: Limit, speed: SpeedLimits, subject: Subject, unit: str
) -> list[Finding]:
    """Checks the switch position, the braking distance after it, and the final position."""
    sign = _sign(homing)
    lower, upper = _mechanics(drive, limit)
    position = homing.position
    if not lower <= position <= upper:
        what = because(
            "robot.homing.unreachable", remedy("correct_mechanics"),
            position=position, lower=lower, upper=upper, unit=unit,
        )  # fmt: skip
        return [error(ROBOT_FILE, subject, what)]
    found = []
    if sign * (position - (limit.lower + limit.upper) / 2.0) < 0.0:
        correct, direction = remedy("correct_direction"), str(homing.direction)
        found.append(because("robot.homing.nearer_other", correct, direction=direction, position=position, unit=unit))
    farthest = position + sign * homing.fast**2 / (2.0 * speed.acceleration)
    if not lower <= farthest <= upper:
        found.append(because("robot.homing.runs_on", remedy("brake_earlier"), position=farthest, unit=unit))
    rest = position - sign * homing.back_off
    if not limit.lower <= rest <= limit.upper:
        what = because(
            "robot.homing.rests_outside", remedy("longer_back_off"),
            position=rest, lower=limit.lower, upper=limit.upper, unit=unit,
        )  # fmt: skip
        found.append(what)
    return [error(ROBOT_FILE, subject, what) for what in found]


def _travel(homing: Homing, limit: Limit, subject: Subject, unit: str) -> list[Finding]:
    """Checks that the switch is reached from the far end, within max_travel and timeout."""
    found = []
    far = limit.lower if homing.direction is HomingDirection.UPPER else limit.upper
    travel, most = abs(homing.position - far), homing.max_travel
    if most is not None and most < travel:
        longer = remedy("longer_key", key="max_travel")
        found.append(because("robot.homing.max_travel", longer, value=most, travel=travel, unit=unit))
    time = travel / homing.fast + homing.back_off * (2.0 / homing.fast + 1.0 / homing.slow)
    if time > homing.timeout:
        longer = remedy("longer_key", key="timeout")
        found.append(because("robot.homing.timeout", longer, time=time, limit=homing.timeout))
    return [warning(ROBOT_FILE, subject, what) for what in found]


def _limit_switch(homing: Homing, robot: RobotFile, limit: Limit, subject: Subject, unit: str) -> list[Finding]:
    """A limit switch within the travel would be a fault of a goal that is allowed."""
    switch = _input(homing, robot)
    if switch is None or switch.role not in END_OF or not limit.lower <= homing.position <= limit.upper:
        return []
    what = because(
        "robot.homing.within_travel", remedy("make_it_home"), switch=switch.name, position=homing.position, unit=unit
    )
    return [error(ROBOT_FILE, subject, what)]


def _mechanics(drive: StepperJoint, limit: Limit) -> tuple[float, float]:
    """[rad] or [m] where the joint cannot go on: the URDF's limits where robot.toml knows no better."""
    lower = limit.lower if drive.mechanical_lower is None else drive.mechanical_lower
    upper = limit.upper if drive.mechanical_upper is None else drive.mechanical_upper
    return lower, upper


def _sign(homing: Homing) -> int:
    return 1 if homing.direction is HomingDirection.UPPER else -1
