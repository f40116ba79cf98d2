"""Checks of the controller board in robot.toml: its pins, switches, outputs and sensors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from gemelo.libraries.arm.checks.findings import Finding, error
from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.schemas.device_config import InputRole, SensorKind
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.robot import Input, RobotFile, Sensor

RESERVED_NAMES = ("t_us", "boot_id")  # by the message that carries the readings


def check_device(robot: RobotFile) -> list[Finding]:
    """Everything that is wired to the board."""
    findings = _pins(robot)
    for kind, things in (("input", robot.input), ("output", robot.output), ("sensor", robot.sensor)):
        findings += _twice(kind, [subject.name for subject in things])
    findings += _estops(robot)
    for switch in robot.input:
        findings += _switch(switch, robot)
    for sensor in robot.sensor:
        findings += _sensor(sensor)
    return findings


def _pins(robot: RobotFile) -> list[Finding]:
    """One signal a pin."""
    users: dict[int, list[str]] = {}
    for pin, user in _signals(robot):
        users.setdefault(pin, []).append(user)
    return [
        error(ROBOT_FILE, f"pin {pin}", f"is used {len(by)} times: {', '.join(by)}", "one signal a pin")
        for pin, by in users.items()
        if len(by) > 1
    ]


def _signals(robot: RobotFile) -> Iterable[tuple[int, str]]:
    """Every pin that is named, with what it is for."""
    signals: list[tuple[int | None, str]] = [(robot.device.enable_pin, "[device] enable_pin")]
    for joint in robot.joint:
        signals += [
            (joint.motor.step_pin, f"{joint.name}'s step_pin"),
            (joint.motor.dir_pin, f"{joint.name}'s dir_pin"),
        ]
    signals += [(switch.pin, f'"{switch.name}"') for switch in robot.input]
    signals += [(output.pin, f'"{output.name}"') for output in robot.output]
    signals += [(sensor.pin, f'"{sensor.name}"') for sensor in robot.sensor]
    signals += [(sensor.trigger_pin, f'"{sensor.name}"\'s trigger_pin') for sensor in robot.sensor]
    drive = robot.gripper.drive if robot.gripper is not None else None
    if isinstance(drive, PulseDrive):
        signals.append((drive.pin, "the gripper's pin"))
    return ((pin, user) for pin, user in signals if pin is not None)


def _twice(kind: str, names: list[str]) -> list[Finding]:
    return [
        error(ROBOT_FILE, f'{kind} "{name}"', f"is there {count} times", "give every one a name of its own")
        for name, count in Counter(names).items()
        if count > 1
    ]


def _estops(robot: RobotFile) -> list[Finding]:
    stops = [switch.name for switch in robot.input if switch.role is InputRole.ESTOP]
    if len(stops) < 2:
        return []
    remedy = "wire the buttons' contacts in series to one pin"
    return [error(ROBOT_FILE, f'input "{stops[1]}"', f'is a second e-stop besides "{stops[0]}"', remedy)]


def _switch(switch: Input, robot: RobotFile) -> list[Finding]:
    """A limit or home switch belongs to one joint, an e-stop to all."""
    subject, names = f'input "{switch.name}"', [joint.name for joint in robot.joint]
    if switch.role is InputRole.ESTOP:
        message = f'an e-stop belongs to all joints, not to "{switch.joint}"'
        return [error(ROBOT_FILE, subject, message, "remove `joint`")] if switch.joint else []
    if not switch.joint:
        return [error(ROBOT_FILE, subject, f"a {switch.role} switch belongs to a joint", "write `joint`")]
    if switch.joint not in names:
        return [error(ROBOT_FILE, subject, f'there is no joint "{switch.joint}"{suggestion(switch.joint, names)}')]
    return []


def _sensor(sensor: Sensor) -> list[Finding]:
    subject, findings = f'sensor "{sensor.name}"', []
    if sensor.name in RESERVED_NAMES:
        findings.append(error(ROBOT_FILE, subject, "this name is taken by the readings' message", "choose another one"))
    if sensor.kind is SensorKind.ULTRASONIC and sensor.trigger_pin is None:
        findings.append(error(ROBOT_FILE, subject, "an ultrasonic sensor is asked by a pulse", "write trigger_pin"))
    if sensor.kind is not SensorKind.ULTRASONIC and sensor.trigger_pin is not None:
        findings.append(error(ROBOT_FILE, subject, f"a sensor of kind {sensor.kind} has no trigger_pin", "remove it"))
    if sensor.scale == 0.0:
        findings.append(error(ROBOT_FILE, subject, "its scale is 0: it would always read the same", "write its scale"))
    return findings
