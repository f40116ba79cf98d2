"""The gripper of robot.toml: what of it can be wrong, and its opening as pulses of a servo and readings of a sensor."""

from __future__ import annotations

from pathlib import Path

from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.robot_file import line_of
from gemelo.schemas.device_config import SensorKind
from gemelo.schemas.robot import OutputGripper, RobotFile, Sensor, ServoGripper

METRES = {"mm": 0.001, "m": 1.0}  # [m] of a sensor's unit
LEAST_PULSES = 100  # [us] between open and closed: a servo cannot tell less apart from noise
LEAST_PULSE_SPEED, MOST_PULSE_SPEED = 10, 1_000_000  # [us/s] the firmware's bounds


def require_gripper(robot: RobotFile, path: Path, text: str) -> None:
    """Raises `DescriptionError` with the line, the value and the remedy for a gripper that cannot be."""
    gripper = robot.gripper
    if gripper is None:
        return
    key, reason = "", ""
    if gripper.open <= gripper.closed:
        key, reason = "open", f"{gripper.open:g} m is not wider than closed, {gripper.closed:g} m: write the wider one"
    elif isinstance(gripper, OutputGripper):
        names = [output.name for output in robot.output]
        if gripper.output not in names:
            key, reason = "output", f'"{gripper.output}" is no [[output]]{suggestion(gripper.output, names)}'
    else:
        key, reason = _servo_fault(gripper, robot)
    if reason:
        raise DescriptionError(f"{path}, line {line_of(('gripper', key), text)}: [gripper] {key} {reason}")


def _servo_fault(gripper: ServoGripper, robot: RobotFile) -> tuple[str, str]:
    """The key that is wrong and why; both empty if none is."""
    if abs(gripper.open_us - gripper.closed_us) < LEAST_PULSES:
        return "open_us", (
            f"{gripper.open_us} us and closed_us {gripper.closed_us} us are nearer than {LEAST_PULSES} us: "
            "write the pulses that open and close it"
        )
    if not LEAST_PULSE_SPEED <= pulse_speed(gripper) <= MOST_PULSE_SPEED:
        metres = (gripper.open - gripper.closed) / abs(gripper.open_us - gripper.closed_us)
        return "speed", (
            f"{gripper.speed:g} m/s is {pulse_speed(gripper):.0f} us/s of pulse: write "
            f"{LEAST_PULSE_SPEED * metres:.2g} to {MOST_PULSE_SPEED * metres:.2g} m/s"
        )
    if not gripper.sensor:
        return "", ""
    names = [sensor.name for sensor in robot.sensor]
    if gripper.sensor not in names:
        return "sensor", f'"{gripper.sensor}" is no [[sensor]]{suggestion(gripper.sensor, names)}'
    return "sensor", _sensor_fault(robot.sensor[names.index(gripper.sensor)])


def _sensor_fault(sensor: Sensor) -> str:
    if sensor.kind is not SensorKind.ANALOG:
        return f'"{sensor.name}" is of kind {sensor.kind}: the wire of a servo\'s potentiometer is analog'
    if sensor.unit not in METRES:
        return f'"{sensor.name}" reads in "{sensor.unit}": the opening is a length, write unit = "mm" and its scale'
    return ""


def pulse_speed(gripper: ServoGripper) -> float:
    """[us/s] by which the pulse changes."""
    return gripper.speed * abs(gripper.open_us - gripper.closed_us) / (gripper.open - gripper.closed)


def pulse_of(gripper: ServoGripper, opening: float) -> float:
    """[us] of the pulse that opens the jaws to `opening` [m]."""
    share = (opening - gripper.closed) / (gripper.open - gripper.closed)
    return gripper.closed_us + share * (gripper.open_us - gripper.closed_us)


def opening_of(gripper: ServoGripper, pulse_us: float) -> float:
    """[m] between the jaws under a pulse of `pulse_us` [us]."""
    share = (pulse_us - gripper.closed_us) / (gripper.open_us - gripper.closed_us)
    return gripper.closed + share * (gripper.open - gripper.closed)
