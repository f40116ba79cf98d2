"""The gripper of robot.toml: what of it can be wrong, and its opening as pulses of a servo and readings of a sensor."""

from __future__ import annotations

from pathlib import Path

from gemelo.libraries.arm.errors import nearest, wrong_file
from gemelo.libraries.arm.model.robot_file import line_of
from gemelo.schemas.device_config import SensorKind
from gemelo.schemas.grippers.gripper import Drive, PulseDrive
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.robot import RobotFile

Fault = tuple[str, Reason]  # the key that is wrong, and why

METRES = {"mm": 0.001, "m": 1.0}  # [m] of a sensor's unit
LEAST_PULSES = 100  # [us] between open and closed: a servo cannot tell less apart from noise
LEAST_PULSE_SPEED, MOST_PULSE_SPEED = 10, 1_000_000  # [us/s] the firmware's bounds


def require_gripper(robot: RobotFile, path: Path, text: str) -> None:
    """Raises `DescriptionError` with the line, the value and the remedy for a gripper that cannot be."""
    gripper = robot.gripper
    if gripper is None:
        return
    key, own = gripper.fault()
    found: Fault | None = (key, own if isinstance(own, Reason) else plain(own)) if own else None
    if gripper.open <= gripper.closed:
        found = "open", because("robot.gripper.closed", open=gripper.open, closed=gripper.closed)
    elif found is None:
        found = _drive_fault(gripper.drive, robot)
    if found is not None:
        key, why = found
        raise wrong_file(path, because("robot.gripper", why, key=key), line_of(("gripper", key), text) or 1)


def _drive_fault(drive: Drive, robot: RobotFile) -> Fault | None:
    """The key that is wrong and why."""
    if isinstance(drive, PulseDrive):
        return _pulse_fault(drive, robot)
    names = [output.name for output in robot.output]
    if drive.output not in names:
        return "output", because("robot.gripper.no_output", nearest(drive.output, names), output=drive.output)
    return None


def _pulse_fault(drive: PulseDrive, robot: RobotFile) -> Fault | None:
    if abs(drive.open_us - drive.closed_us) < LEAST_PULSES:
        pulses = {"open": drive.open_us, "closed": drive.closed_us, "limit": LEAST_PULSES}
        return "open_us", because("robot.gripper.pulses", **pulses)
    if not LEAST_PULSE_SPEED <= pulse_speed(drive) <= MOST_PULSE_SPEED:
        metres = (drive.open - drive.closed) / abs(drive.open_us - drive.closed_us)
        return "speed", because(
            "robot.gripper.speed", speed=drive.speed, pulses=pulse_speed(drive),
            least=LEAST_PULSE_SPEED * metres, most=MOST_PULSE_SPEED * metres,
        )  # fmt: skip
    if not drive.sensor:
        return None
    names = [sensor.name for sensor in robot.sensor]
    if drive.sensor not in names:
        return "sensor", because("robot.gripper.no_sensor", nearest(drive.sensor, names), sensor=drive.sensor)
    sensor = robot.sensor[names.index(drive.sensor)]
    if sensor.kind is not SensorKind.ANALOG:
        return "sensor", because("robot.gripper.sensor_kind", sensor=sensor.name, kind=str(sensor.kind))
    if sensor.unit not in METRES:
        return "sensor", because("robot.gripper.sensor_unit", sensor=sensor.name, unit=sensor.unit)
    return None


def pulse_speed(drive: PulseDrive) -> float:
    """[us/s] by which the pulse changes."""
    return drive.speed * abs(drive.open_us - drive.closed_us) / (drive.open - drive.closed)


def pulse_of(drive: PulseDrive, opening: float) -> float:
    """[us] of the pulse that opens the jaws to `opening` [m]."""
    share = (opening - drive.closed) / (drive.open - drive.closed)
    return drive.closed_us + share * (drive.open_us - drive.closed_us)


def opening_of(drive: PulseDrive, pulse_us: float) -> float:
    """[m] between the jaws under a pulse of `pulse_us` [us]."""
    share = (pulse_us - drive.closed_us) / (drive.open_us - drive.closed_us)
    return drive.closed + share * (drive.open - drive.closed)
