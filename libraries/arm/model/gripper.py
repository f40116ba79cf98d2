"""The gripper of robot.toml: what of it can be wrong, and its opening as pulses of a servo and readings of a sensor."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.robot_file import line_of
from gemelo.schemas.device_config import SensorKind
from gemelo.schemas.frames import Transform
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.robot import Gripper, OutputGripper, RobotFile, Sensor, ServoGripper
from gemelo.schemas.scene import BoxShape, SceneObject

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

METRES = {"mm": 0.001, "m": 1.0}  # [m] of a sensor's unit
JAW = (0.01, 0.005, 0.02)  # [m] the edges of a jaw that robot.toml does not give
JAWS = ("gripper_jaw_1", "gripper_jaw_2")  # the names that collisions with them have
APART = 0.0005  # [m] by which openings are told apart
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
        line = line_of(("gripper", key), text) or line_of(("gripper",), text)
        raise DescriptionError(f"{path}, line {line}: [gripper] {key} {reason}")


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


def jaw_edges(gripper: Gripper) -> tuple[float, float, float]:
    """(3,) [m] of one jaw: along x, y and z of the tool frame, which it begins at."""
    return gripper.jaw or JAW


def jaw_objects(arm: ArmDescription, opening: float) -> tuple[SceneObject, ...]:
    """The two jaws as boxes that the tool carries, [m] apart as far as `opening`; none where robot.toml gives no jaw.

    They touch what is fixed to the tool.
    """
    if arm.gripper is None or arm.gripper.jaw is None:
        return ()
    size = arm.gripper.jaw
    holders = tuple(joint.parent for joint in arm.model.joints if joint.child == arm.tool_frame)
    away = (opening + size[1]) / 2.0
    return tuple(
        SceneObject(
            name=name,
            shape=BoxShape(size=size),
            pose=Transform(translation=(0.0, y, size[2] / 2.0), rotation=(0.0, 0.0, 0.0, 1.0)),
            frame=arm.tool_frame,
            attached=True,
            touch_links=holders,
        )
        for name, y in zip(JAWS, (away, -away), strict=True)
    )


def jaws_apart(arm: ArmDescription, state: GripperState | None) -> float:
    """[m] that the jaws take up: as far as they are apart and will be; open where that is not known."""
    if arm.gripper is None:
        return 0.0
    if state is None or not state.known:
        return arm.gripper.open
    widest = max(state.position, state.target) if state.moving else state.position
    within = min(max(widest, arm.gripper.closed), arm.gripper.open)  # a foreign word of 1e308 m cannot be rounded
    return min(max(round(within / APART) * APART, arm.gripper.closed), arm.gripper.open)


def gripper_unit(arm: ArmDescription) -> str:
    """The unit of the sensor that reads the jaws; "mm" where none does."""
    name = arm.gripper.sensor if isinstance(arm.gripper, ServoGripper) else ""
    return next((sensor.unit for sensor in arm.sensors if sensor.name == name), "mm")
