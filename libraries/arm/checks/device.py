"""Checks of the controller board in robot.toml: its pins, switches, outputs and sensors."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from gemelo.libraries.arm.checks.findings import Finding, error
from gemelo.libraries.arm.errors import Subject, nearest
from gemelo.libraries.arm.model.description import ROBOT_FILE
from gemelo.schemas.device_config import InputRole, SensorKind
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.reasons import because, remedy
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
        error(
            ROBOT_FILE,
            Subject("pin", str(pin)),
            because("robot.pin.twice", remedy("one_signal_a_pin"), count=len(by), users=tuple(by)),
        )
        for pin, by in users.items()
        if len(by) > 1
    ]


def _signals(robot: RobotFile) -> Iterable[tuple[int, str]]:
    """Every pin that is named, with what it is for."""
    signals: list[tuple[int | None, str]] = [(robot.device.enable_pin, "[device] enable_pin")]
    for joint in robot.joint:
        signals += [
            (joint.motor.step_pin, f"{joint.name} step_pin"),
            (joint.motor.dir_pin, f"{joint.name} dir_pin"),
        ]
    signals += [(switch.pin, f'"{switch.name}"') for switch in robot.input]
    signals += [(output.pin, f'"{output.name}"') for output in robot.output]
    signals += [(sensor.pin, f'"{sensor.name}"') for sensor in robot.sensor]
    signals += [(sensor.trigger_pin, f'"{sensor.name}" trigger_pin') for sensor in robot.sensor]
    drive = robot.gripper.drive if robot.gripper is not None else None
    if isinstance(drive, PulseDrive):
        signals.append((drive.pin, "[gripper] pin"))
    return ((pin, user) for pin, user in signals if pin is not None)


def _twice(kind: str, names: list[str]) -> list[Finding]:
    return [
        error(ROBOT_FILE, Subject(kind, name), because("robot.name.twice", remedy("own_name"), count=count))
        for name, count in Counter(names).items()
        if count > 1
    ]


def _estops(robot: RobotFile) -> list[Finding]:
    stops = [switch.name for switch in robot.input if switch.role is InputRole.ESTOP]
    if len(stops) < 2:
        return []
    what = because("robot.estop.second", remedy("wire_in_series"), first=stops[0])
    return [error(ROBOT_FILE, Subject("input", stops[1]), what)]


def _switch(switch: Input, robot: RobotFile) -> list[Finding]:
    """A limit or home switch belongs to one joint, an e-stop to all."""
    subject, names = Subject("input", switch.name), [joint.name for joint in robot.joint]
    if switch.role is InputRole.ESTOP:
        what = because("robot.estop.joint", remedy("remove_key", key="joint"), joint=switch.joint)
        return [error(ROBOT_FILE, subject, what)] if switch.joint else []
    if not switch.joint:
        what = because("robot.switch.no_joint", remedy("write_key", key="joint"), role=str(switch.role))
        return [error(ROBOT_FILE, subject, what)]
    if switch.joint not in names:
        what = because("robot.joint.none", nearest(switch.joint, names), joint=switch.joint)
        return [error(ROBOT_FILE, subject, what)]
    return []


def _sensor(sensor: Sensor) -> list[Finding]:
    found = []
    if sensor.name in RESERVED_NAMES:
        found.append(because("robot.sensor.reserved", remedy("another_name")))
    if sensor.kind is SensorKind.ULTRASONIC and sensor.trigger_pin is None:
        found.append(because("robot.sensor.no_trigger", remedy("write_key", key="trigger_pin")))
    if sensor.kind is not SensorKind.ULTRASONIC and sensor.trigger_pin is not None:
        kind = str(sensor.kind)
        found.append(because("robot.sensor.trigger", remedy("remove_key", key="trigger_pin"), kind=kind))
    if sensor.scale == 0.0:
        found.append(because("robot.sensor.scale", remedy("write_key", key="scale")))
    return [error(ROBOT_FILE, Subject("sensor", sensor.name), what) for what in found]
