"""Checks of robot.toml against the URDF and against what pulses and motors allow: drives, steps, pulse rates and
widths, and the curve of [joint.motor.pull_out]."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import DescriptionError, Subject, nearest
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.libraries.arm.model.urdf import JointKind, Limit, UrdfJoint, UrdfModel
from gemelo.libraries.arm.motors.speed import fastest_steps, speed_limits
from gemelo.libraries.arm.motors.steps import Q8, step_scale
from gemelo.libraries.arm.motors.torque import torque_at
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import Driver, PullOut, RobotFile, StepperJoint, Transmission

WIRE_RANGE = 2**31 / Q8  # [steps] that fit the wire's Q24.8
COARSE = 0.02  # [rad] a step beyond which a joint is said to be coarse
COARSE_METRES = 0.001  # [m]


def check_motors(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    """Every [[joint]] and the names that robot.toml refers to."""
    findings = _names(robot, model)
    drivers = {driver.name: driver for driver in robot.driver}
    for drive in robot.joint:
        subject = Subject("joint", drive.name)
        if drive.name not in model.joint_names:
            near = nearest(drive.name, model.joint_names)
            findings.append(error(ROBOT_FILE, subject, because("robot.joint.not_in_urdf", near)))
            continue
        findings += _drive(drive, model.joint(drive.name), subject)
        driver = drivers.get(drive.motor.driver)
        if driver is None:
            near = nearest(drive.motor.driver, drivers)
            findings.append(error(ROBOT_FILE, subject, because("robot.driver.none", near, driver=drive.motor.driver)))
        else:
            findings += _pulses(drive, driver, robot.device.tick_hz, subject)
    return findings


def _names(robot: RobotFile, model: UrdfModel) -> list[Finding]:
    findings = []
    for key, frame in (("base_frame", robot.base_frame), ("tool_frame", robot.tool_frame)):
        if frame not in model.link_names:
            near = nearest(frame, model.link_names)
            findings.append(error(ROBOT_FILE, Subject(key), because("robot.frame.none", near, frame=frame)))
    for key, names in (("name", [j.name for j in robot.joint]), ("wire_name", [j.wire_name for j in robot.joint])):
        for name, count in Counter(names).items():
            if count > 1:
                what = because("robot.joint.twice", key=key, count=count)
                findings.append(error(ROBOT_FILE, Subject("joint", name), what))
    driven = {drive.name for drive in robot.joint}
    for joint in model.joints:
        if joint.kind is not JointKind.FIXED and joint.mimic is None and joint.name not in driven:
            what = because("robot.joint.no_motor", remedy("add_joint_or_fix"))
            findings.append(error(ROBOT_FILE, Subject("joint", joint.name), what))
    return findings


def _drive(drive: StepperJoint, joint: UrdfJoint, subject: Subject) -> list[Finding]:
    """Steps, speed and travel of one joint."""
    slides = joint.kind is JointKind.PRISMATIC
    if slides != (drive.transmission is Transmission.RACK_AND_PINION):
        needed = Transmission.RACK_AND_PINION if slides else Transmission.ROTARY
        kind, given = str(joint.kind), str(drive.transmission)
        other = remedy("write_transmission", transmission=str(needed))
        return [error(ROBOT_FILE, subject, because("robot.transmission", other, kind=kind, transmission=given))]
    try:
        scale, speed = step_scale(drive), speed_limits(drive)
    except DescriptionError as problem:
        return [error(ROBOT_FILE, subject, problem.reason.causes[0])]
    findings = []
    if joint.limit is not None:
        findings += _against_limits(drive, joint, subject, scale.per_unit, speed.velocity)
    if scale.resolution > (COARSE_METRES if slides else COARSE):
        what = because("robot.motor.coarse", remedy("microsteps"), step=scale.resolution)
        if slides:
            what = because("robot.motor.coarse_slide", remedy("microsteps"), step=scale.resolution)
        findings.append(warning(ROBOT_FILE, subject, what))
    return findings


def _against_limits(
    drive: StepperJoint, joint: UrdfJoint, subject: Subject, per_unit: float, velocity: float
) -> list[Finding]:
    """The URDF may not promise what the mechanics cannot do."""
    findings: list[Finding] = []
    limit = joint.limit
    if limit is None:
        return findings
    unit = "m" if joint.kind is JointKind.PRISMATIC else "rad"
    if limit.velocity > 2.0 * velocity:
        correct, urdf = remedy("slower_is_used"), limit.velocity
        what = because("robot.motor.slower_than_urdf", correct, urdf=urdf, motor=velocity, unit=unit)
        findings.append(warning(ROBOT_FILE, subject, what))
    if joint.kind is JointKind.CONTINUOUS:
        return findings
    findings += _against_mechanics(drive, limit, subject, unit)
    if not limit.lower <= drive.reference_position <= limit.upper:
        what = because(
            "robot.reference.outside", remedy("reference_within"),
            position=drive.reference_position, lower=limit.lower, upper=limit.upper, unit=unit,
        )  # fmt: skip
        findings.append(error(ROBOT_FILE, subject, what))
    farthest = max(abs(limit.lower), abs(limit.upper)) * per_unit
    if farthest > WIRE_RANGE:
        what = because("robot.motor.steps", remedy("fewer_microsteps"), steps=farthest, limit=WIRE_RANGE)
        findings.append(error(ROBOT_FILE, subject, what))
    return findings


def _against_mechanics(drive: StepperJoint, limit: Limit, subject: Subject, unit: str) -> list[Finding]:
    """The URDF's limits within what robot.toml says that the mechanics allow."""
    findings = []
    for side, urdf, mechanical, is_beyond in (
        ("lower", limit.lower, drive.mechanical_lower, float.__lt__),
        ("upper", limit.upper, drive.mechanical_upper, float.__gt__),
    ):
        if mechanical is not None and is_beyond(urdf, mechanical):
            write = remedy("write_in_urdf", text=f'{side}="{mechanical:g}"')
            what = because("robot.joint.mechanics", write, side=side, limit=urdf, mechanics=mechanical, unit=unit)
            findings.append(error(ROBOT_FILE, subject, what))
    return findings


def _pulses(drive: StepperJoint, driver: Driver, tick_hz: int, subject: Subject) -> list[Finding]:
    """Checks that the device's tick and the driver's inputs support the joint's highest step rate."""
    try:
        rate = float(speed_limits(drive).step_rate)
    except DescriptionError:
        return []
    fastest = fastest_steps(driver, tick_hz)
    findings = []
    if rate > fastest:
        what = because(
            "robot.motor.pulses", remedy("lower_rate"),
            rate=rate, rpm=drive.max_speed_rpm, driver=driver.name, high=driver.step_high_us * 1e-6,
            low=driver.step_low_us * 1e-6, fastest=fastest, tick=1.0 / tick_hz,
        )  # fmt: skip
        findings.append(error(ROBOT_FILE, subject, what))
    elif rate > 0.8 * fastest:
        share = rate / fastest
        what = because("robot.motor.little_room", remedy("leave_room"), rate=rate, share=share, fastest=fastest)
        findings.append(warning(ROBOT_FILE, subject, what))
    return findings


def check_pull_out(robot: RobotFile) -> list[Finding]:
    """Every motor whose torque is known."""
    findings: list[Finding] = []
    for drive in robot.joint:
        curve = drive.motor.pull_out
        if curve is not None:
            subject = Subject("joint", drive.name)
            wrong = _shape(curve, subject)
            findings += wrong or _demand(drive, curve, subject)
    return findings


def _shape(curve: PullOut, subject: Subject) -> list[Finding]:
    if not curve.speed or len(curve.speed) != len(curve.torque):
        speeds, torques = len(curve.speed), len(curve.torque)
        what = because("robot.pull_out.lengths", remedy("torque_for_speed"), speeds=speeds, torques=torques)
        return [error(ROBOT_FILE, subject, what)]
    for slower, faster in pairwise(curve.speed):
        if faster <= slower:
            what = because("robot.pull_out.falls", remedy("rising_order"), first=slower, second=faster)
            return [error(ROBOT_FILE, subject, what)]
    return []


def _demand(drive: StepperJoint, curve: PullOut, subject: Subject) -> list[Finding]:
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
    what = because(
        "robot.pull_out.weak", remedy("slower_or_longer_ramp"),
        rpm=drive.max_speed_rpm, given=given, rate=float(speed.step_rate), needed=needed,
    )  # fmt: skip
    return [warning(ROBOT_FILE, subject, what)]
