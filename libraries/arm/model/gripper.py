"""The gripper of robot.toml: what of it can be wrong, and its opening as pulses of a servo and readings of a sensor."""

from __future__ import annotations

from pathlib import Path

from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.robot_file import line_of
from gemelo.schemas.device_config import SensorKind
from gemelo.schemas.grippers.gripper import Drive, PulseDrive
from gemelo.schemas.robot import RobotFile, Sensor

METRES = {"mm": 0.001, "m": 1.0}  # [m] of a sensor's unit
LEAST_PULSES = 100  # [us] between open and closed: a servo cannot tell less apart from noise
LEAST_PULSE_SPEED, MOST_PULSE_SPEED = 10, 1_000_000  # [us/s] the firmware's bounds


def require_gripper(robot: RobotFile, path: Path, text: str) -> None:
    """Raises `DescriptionError` with the line, the value and the remedy for a gripper that cannot be."""
    gripper = robot.gripper
    if gripper is None:
        return
    key, reason = gripper.fault()
    if gripper.open <= gripper.closed:
        key, reason = "open", f"{gripper.open:g} m is not wider than closed, {gripper.closed:g} m: write the wider one"
    elif not reason:
        key, reason = _drive_fault(gripper.drive, robot)
    if reason:
        raise DescriptionError(f"{path}, line {line_of(('gripper', key), text)}: [gripper] {key} {reason}")


def _drive_fault(drive: Drive, robot: RobotFile) -> tuple[str, str]:
    """The key that is wrong and why; both empty if none is."""
    if isinstance(drive, PulseDrive):
        return _pulse_fault(drive, robot)
    names = [output.name for output in robot.output]
    if drive.output not in names:
        return "output", f'"{drive.output}" is no [[output]]{suggestion(drive.output, names)}'
    return "", ""


def _pulse_fault(drive: PulseDrive, robot: RobotFile) -> tuple[str, str]:
    if abs(drive.open_us - drive.closed_us) < LEAST_PULSES:
        return "open_us", (
            f"{drive.open_us} us and closed_us {drive.closed_us} us are nearer than {LEAST_PULSES} us: "
            "write the pulses that open and close it"
        )
    if not LEAST_PULSE_SPEED <= pulse_speed(drive) <= MOST_PULSE_SPEED:
        metres = (drive.open - drive.closed) / abs(drive.open_us - drive.closed_us)
        return "speed", (
            f"{drive.speed:g} m/s is {pulse_speed(drive):.0f} us/s of pulse: write "
            f"{LEAST_PULSE_SPEED * metres:.2g} to {MOST_PULSE_SPEED * metres:.2g} m/s"
        )
    if not drive.sensor:
        return "", ""
    names = [sensor.name for sensor in robot.sensor]
    if drive.sensor not in names:
        return "sensor", f'"{drive.sensor}" is no [[sensor]]{suggestion(drive.sensor, names)}'
    return "sensor", _sensor_fault(robot.sensor[names.index(drive.sensor)])


def _sensor_fault(sensor: Sensor) -> str:
    if sensor.kind is not SensorKind.ANALOG:
        return f'"{sensor.name}" is of kind {sensor.kind}: the wire of a servo\'s potentiometer is analog'
    if sensor.unit not in METRES:
        return f'"{sensor.name}" reads in "{sensor.unit}": the opening is a length, write unit = "mm" and its scale'
    return ""


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
