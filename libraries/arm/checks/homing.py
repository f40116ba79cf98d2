"""Checks of [joint.homing]: that the switch is there, can be found, and leaves the joint where it may work."""

from __future__ import annotations

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfModel
from gemelo.libraries.arm.motors.speed import SpeedLimits, speed_limits
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.robot import Homing, HomingDirection, Input, RobotFile, StepperJoint

END_OF = {InputRole.LIMIT_LOWER: HomingDirection.LOWER, InputRole.LIMIT_UPPER: HomingDirection.UPPER}


def check_homing(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Every joint that homes; what `check_motors` finds first is not said again."""
    findings: list[Finding] = []
    for drive in robot.joint:
        if drive.homing is None or drive.name not in model.joint_names:
            continue
        subject = f'joint "{drive.name}"'
        findings += _switch(drive, drive.homing, robot, subject)
        try:
            speed = speed_limits(drive)
        except DescriptionError:
            continue
        findings += _speeds(drive.homing, speed, subject)
        joint = model.joint(drive.name)
        if joint.limit is not None and joint.kind is not JointKind.CONTINUOUS:
            unit = "m" if joint.kind is JointKind.PRISMATIC else "rad"
            findings += _places(drive, drive.homing, joint.limit, speed, subject, unit)
            findings += _travel(drive.homing, joint.limit, subject, unit)
            findings += _limit_switch(drive.homing, robot, joint.limit, subject, unit)
    return findings


def _switch(drive: StepperJoint, homing: Homing, robot: RobotFile, subject: str) -> list[Finding]:
    switch = _input(homing, robot)
    if switch is None:
        hint = suggestion(homing.switch, [one.name for one in robot.input])
        return [error(ROBOT_FILE, subject, f'its home switch "{homing.switch}" is no [[input]]{hint}')]
    if switch.joint != drive.name:
        whose = f'of joint "{switch.joint}"' if switch.joint else f"an {switch.role}"
        return [
            error(ROBOT_FILE, subject, f'its home switch "{switch.name}" is {whose}', "name a switch of this joint")
        ]
    end = END_OF.get(switch.role)
    if end is not None and end is not homing.direction:
        message = f'it homes to its {homing.direction} end, but "{switch.name}" is its {switch.role} switch'
        return [error(ROBOT_FILE, subject, message, f'write direction = "{end}"')]
    return []


def _input(homing: Homing, robot: RobotFile) -> Input | None:
    return next((one for one in robot.input if one.name == homing.switch), None)


def _speeds(homing: Homing, speed: SpeedLimits, subject: str) -> list[Finding]:
    findings = []
    for key, value in (("fast", homing.fast), ("slow", homing.slow)):
        if value > speed.velocity:
            message = f"homing.{key} {value:g} is beyond the {speed.velocity:.4g} of its max_speed_rpm"
            findings.append(error(ROBOT_FILE, subject, message, "home slower"))
    if homing.slow > homing.fast:
        message = f"homing.slow {homing.slow:g} is faster than homing.fast {homing.fast:g}"
        findings.append(error(ROBOT_FILE, subject, message, "the second approach is the exact one: make it slower"))
    return findings


def _places(
    drive: StepperJoint, homing: Homing, limit: Limit, speed: SpeedLimits, subject: str, unit: str
) -> list[Finding]:
    """Checks the switch position, the braking distance after it, and the final position."""
    sign = _sign(homing)
    lower, upper = _mechanics(drive, limit)
    if not lower <= homing.position <= upper:
        message = f"homing.position {homing.position:g} {unit} is outside the mechanics' {lower:g} to {upper:g} {unit}"
        return [
            error(ROBOT_FILE, subject, message, "the joint cannot get there: correct it, or mechanical_lower/_upper")
        ]
    findings = []
    if sign * (homing.position - (limit.lower + limit.upper) / 2.0) < 0.0:
        place = f"homing.position {homing.position:g} {unit}"
        message = f"it homes to its {homing.direction} end, but {place} is nearer the other"
        findings.append(error(ROBOT_FILE, subject, message, "correct direction or position"))
    farthest = homing.position + sign * homing.fast**2 / (2.0 * speed.acceleration)
    if not lower <= farthest <= upper:
        message = f"braking from homing.fast it runs on to {farthest:.4g} {unit}, beyond the mechanics' end"
        findings.append(error(ROBOT_FILE, subject, message, "lower homing.fast, or move the switch inwards"))
    rest = homing.position - sign * homing.back_off
    if not limit.lower <= rest <= limit.upper:
        message = f"homed, it stands at {rest:.4g} {unit}, outside its {limit.lower:g} to {limit.upper:g} {unit}"
        findings.append(error(ROBOT_FILE, subject, message, "no goal could begin there: a longer back_off"))
    return findings


def _travel(homing: Homing, limit: Limit, subject: str, unit: str) -> list[Finding]:
    """Checks that the switch is reached from the far end, within max_travel and timeout."""
    findings = []
    far = limit.lower if homing.direction is HomingDirection.UPPER else limit.upper
    travel = abs(homing.position - far)
    if homing.max_travel is not None and homing.max_travel < travel:
        message = (
            f"homing.max_travel {homing.max_travel:g} {unit} is shorter than the {travel:.4g} {unit} from its far end"
        )
        findings.append(warning(ROBOT_FILE, subject, message, "a longer max_travel"))
    time = travel / homing.fast + homing.back_off * (2.0 / homing.fast + 1.0 / homing.slow)
    if time > homing.timeout:
        message = f"homing from its far end takes {time:.0f} s, longer than its timeout of {homing.timeout:g} s"
        findings.append(warning(ROBOT_FILE, subject, message, "a longer timeout"))
    return findings


def _limit_switch(homing: Homing, robot: RobotFile, limit: Limit, subject: str, unit: str) -> list[Finding]:
    """A limit switch within the travel would be a fault of a goal that is allowed."""
    switch = _input(homing, robot)
    if switch is None or switch.role not in END_OF or not limit.lower <= homing.position <= limit.upper:
        return []
    message = f'its limit switch "{switch.name}" closes at {homing.position:g} {unit}, within its travel'
    return [error(ROBOT_FILE, subject, message, 'make its role "home", or end the travel before it')]


def _mechanics(drive: StepperJoint, limit: Limit) -> tuple[float, float]:
    """[rad] or [m] where the joint cannot go on: the URDF's limits where robot.toml knows no better."""
    lower = limit.lower if drive.mechanical_lower is None else drive.mechanical_lower
    upper = limit.upper if drive.mechanical_upper is None else drive.mechanical_upper
    return lower, upper


def _sign(homing: Homing) -> int:
    return 1 if homing.direction is HomingDirection.UPPER else -1
