"""The jaws of an arm's gripper: as boxes that the tool carries, and how far they are apart."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.scene import BoxShape, SceneObject

JAW = (0.01, 0.005, 0.02)  # [m] the edges of a jaw that robot.toml does not give
JAWS = ("gripper_jaw_1", "gripper_jaw_2")  # the names that collisions with them have
APART = 0.0005  # [m] by which openings are told apart


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


def opening_sensor(arm: ArmDescription) -> str:
    """The name of the sensor that reads the opening; "" where none does."""
    drive = arm.gripper.drive if arm.gripper is not None else None
    return drive.sensor if isinstance(drive, PulseDrive) else ""


def gripper_unit(arm: ArmDescription) -> str:
    """The unit of the sensor that reads the opening; "mm" where none does."""
    name = opening_sensor(arm)
    return next((sensor.unit for sensor in arm.sensors if sensor.name == name), "mm")
