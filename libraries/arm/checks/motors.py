"""Checks of robot.toml against the URDF and against what pulses and motors allow: drives, steps, pulse rates and
widths, and the curve of [joint.motor.pull_out]."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint, UrdfModel
from gemelo.libraries.arm.motors.speed import fastest_steps, speed_limits
from gemelo.libraries.arm.motors.steps import Q8, step_scale
from gemelo.libraries.arm.motors.torque import torque_at
from gemelo.schemas.robot import Driver, PullOut, RobotFile, StepperJoint, Transmission

WIRE_RANGE = 2**31 / Q8  # [steps] that fit the wire's Q24.8
COARSE = 0.02  # [rad] a step beyond which a joint is said to be coarse
COARSE_METRES = 0.001  # [m]


def check_motors(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Every [[joint]] and the names that robot.toml refers to."""
    findings = _names(robot, model)
    drivers = {driver.name: driver for driver in robot.driver}
    for drive in robot.joint:
        subject = f'joint "{drive.name}"'
        if drive.name not in model.joint_names:
            hint = suggestion(drive.name, model.joint_names)
            findings.append(error(ROBOT_FILE, subject, f"is not in the URDF{hint}"))
            continue
        findings += _drive(drive, model.joint(drive.name), subject)
        driver = drivers.get(drive.motor.driver)
        if driver is None:
            hint = suggestion(drive.motor.driver, drivers)
            findings.append(error(ROBOT_FILE, subject, f'there is no [[driver]] "{drive.motor.driver}"{hint}'))
        else:
            findings += _pulses(drive, driver, robot.device.tick_hz, subject)
    return findings


def _names(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    findings = []
    for key, frame in (("base_frame", robot.base_frame), ("tool_frame", robot.tool_frame)):
        if frame not in model.link_names:
            findings.append(error(ROBOT_FILE, key, f'"{frame}" is no link{suggestion(frame, model.link_names)}'))
    for key, names in (("name", [j.name for j in robot.joint]), ("wire_name", [j.wire_name for j in robot.joint])):
        for name, count in Counter(names).items():
            if count > 1:
                findings.append(error(ROBOT_FILE, f'joint "{name}"', f"this {key} is there {count} times"))
    driven = {drive.name for drive in robot.joint}
    for joint in model.joints:
        if joint.kind is not JointKind.FIXED and joint.mimic is None and joint.name not in driven:
            remedy = 'add a [[joint]], or make it type="fixed" in the URDF'
            findings.append(error(ROBOT_FILE, f'joint "{joint.name}"', "moves in the URDF but has no motor", remedy))
    return findings


def _drive(drive: StepperJoint, joint: UrdfJoint, subject: str) -> list[Finding]:
    """Steps, speed and travel of one joint."""
    slides = joint.kind is JointKind.PRISMATIC
    if slides != (drive.transmission is Transmission.RACK_AND_PINION):
        needed = Transmission.RACK_AND_PINION if slides else Transmission.ROTARY
        message = f"is {joint.kind} in the URDF, but its transmission is {drive.transmission}"
        return [error(ROBOT_FILE, subject, message, f'write transmission = "{needed}": metres are not radians')]
    try:
        scale, speed = step_scale(drive), speed_limits(drive)
    except DescriptionError as problem:
        return [error(ROBOT_FILE, subject, str(problem).removeprefix(f"{subject}: "))]
    findings = []
    if joint.limit is not None:
        findings += _against_limits(drive, joint, subject, scale.per_unit, speed.velocity)
    if scale.resolution > (COARSE_METRES if slides else COARSE):
        unit = "mm" if slides else "mrad"
        findings.append(
            warning(ROBOT_FILE, subject, f"one step is {1000 * scale.resolution:.3g} {unit}", "use microsteps")
        )
    return findings


def _against_limits(
    drive: StepperJoint, joint: UrdfJoint, subject: str, per_unit: float, velocity: float
) -> list[Finding]:
    """The URDF may not promise what the mechanics cannot do."""
    findings: list[Finding] = []
    limit = joint.limit
    if limit is None:
        return findings
    unit = "m" if joint.kind is JointKind.PRISMATIC else "rad"
    if limit.velocity > 2.0 * velocity:
        message = f"the URDF allows {limit.velocity:g} {unit}/s, its motor does {velocity:.4g} {unit}/s"
        findings.append(warning(ROBOT_FILE, subject, message, "the slower one is used; correct the URDF"))
    if joint.kind is JointKind.CONTINUOUS:
        return findings
    findings += _against_mechanics(drive, limit, subject, unit)
    if not limit.lower <= drive.reference_position <= limit.upper:
        message = (
            f"reference_position {drive.reference_position:g} {unit} is outside {limit.lower:g} to {limit.upper:g}"
        )
        findings.append(error(ROBOT_FILE, subject, message, "the arm must be able to stand where it is referenced"))
    farthest = max(abs(limit.lower), abs(limit.upper)) * per_unit
    if farthest > WIRE_RANGE:
        message = f"its travel of {farthest:.0f} steps does not fit the wire's {WIRE_RANGE:.0f}"
        findings.append(error(ROBOT_FILE, subject, message, "fewer microsteps"))
    return findings


def _against_mechanics(drive: StepperJoint, limit: Limit, subject: str, unit: str) -> list[Finding]:
    """The URDF's limits within what robot.toml says that the mechanics allow."""
    findings = []
    for side, urdf, mechanical, is_beyond in (
        ("lower", limit.lower, drive.mechanical_lower, float.__lt__),
        ("upper", limit.upper, drive.mechanical_upper, float.__gt__),
    ):
        if mechanical is not None and is_beyond(urdf, mechanical):
            message = f"the URDF's {side} limit {urdf:g} {unit} is beyond the mechanics' {mechanical:g} {unit}"
            findings.append(error(ROBOT_FILE, subject, message, f"write {side}={mechanical:g} in the URDF"))
    return findings


def _pulses(drive: StepperJoint, driver: Driver, tick_hz: int, subject: str) -> list[Finding]:
    """Checks that the device's tick and the driver's inputs support the joint's highest step rate."""
    try:
        rate = float(speed_limits(drive).step_rate)
    except DescriptionError:
        return []
    tick = 1e6 / tick_hz  # [us]
    fastest = fastest_steps(driver, tick_hz)
    findings = []
    if rate > fastest:
        message = (
            f"{rate:.0f} steps/s at {drive.max_speed_rpm:g} RPM, but {driver.name} needs {driver.step_high_us:g} us "
            f"high and {driver.step_low_us:g} us low: {fastest:.0f} steps/s at a tick of {tick:g} us"
        )
        findings.append(
            error(ROBOT_FILE, subject, message, "a lower max_speed_rpm, fewer microsteps or a higher tick_hz")
        )
    elif rate > 0.8 * fastest:
        message = f"{rate:.0f} steps/s is {100 * rate / fastest:.0f} % of the {fastest:.0f} that are possible"
        findings.append(warning(ROBOT_FILE, subject, message, "leave some room for jitter"))
    return findings


def check_pull_out(robot: RobotFile) -> list[Finding]:
    """Every motor whose torque is known."""
    findings: list[Finding] = []
    for drive in robot.joint:
        curve = drive.motor.pull_out
        if curve is not None:
            subject = f'joint "{drive.name}"'
            wrong = _shape(curve, subject)
            findings += wrong or _demand(drive, curve, subject)
    return findings


def _shape(curve: PullOut, subject: str) -> list[Finding]:
    if not curve.speed or len(curve.speed) != len(curve.torque):
        message = f"pull_out has {len(curve.speed)} speeds and {len(curve.torque)} torques"
        return [error(ROBOT_FILE, subject, message, "one torque for each speed")]
    for slower, faster in pairwise(curve.speed):
        if faster <= slower:
            message = f"pull_out.speed falls from {slower:g} to {faster:g} steps/s"
            return [error(ROBOT_FILE, subject, message, "write the speeds in rising order")]
    return []


def _demand(drive: StepperJoint, curve: PullOut, subject: str) -> list[Finding]:
    """The torque at full speed while still accelerating, as the end of a ramp is."""
    try:
        speed = speed_limits(drive)
    except DescriptionError:
        return []
    radians = math.tau / drive.motor.pulses_per_turn  # [rad/step] of the motor shaft
    needed = curve.friction + curve.inertia * float(speed.step_acceleration) * radians
    given = torque_at(curve, float(speed.step_rate))
    if needed <= given:
        return []
    message = (
        f"at {drive.max_speed_rpm:g} RPM its motor gives {given:.3g} N m at {float(speed.step_rate):.0f} steps/s, "
        f"but needs {needed:.3g} N m: it will lose steps"
    )
    return [warning(ROBOT_FILE, subject, message, "a lower max_speed_rpm or a longer ramp_time")]
