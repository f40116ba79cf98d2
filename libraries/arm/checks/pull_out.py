"""Checks of [joint.motor.pull_out]: a curve that is one, and a joint that keeps under it."""

from __future__ import annotations

import math
from itertools import pairwise

from gemelo.libraries.arm.checks.findings import Finding, error, warning
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.libraries.arm.motors.speed import speed_limits
from gemelo.libraries.arm.motors.torque import torque_at
from gemelo.schemas.robot import PullOut, RobotFile, StepperJoint


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
