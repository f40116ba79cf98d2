"""The table of topics and the methods of the core that take them, live and from a recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.jaws import jaw_objects, jaws_apart
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.topics import (
    CONTACTS,
    CONTROL,
    DEVICE_EVENTS,
    DEVICE_SHAFT,
    DEVICE_STATE,
    DEVICE_STATUS,
    GRIPPER_STATE,
    JOINT_COMMANDS,
    JOINT_STATES,
    LOG,
    PLANNED_PATH,
    SCENE,
    SENSORS,
    STEP_ERRORS,
    STEP_LEDGER,
    STOPPING_DISTANCE,
    Topic,
    camera_detections,
    camera_image,
    camera_info,
)
from gemelo.services.visualizer.core import Visualizer


class Feed(NamedTuple):
    """A topic, and who takes its messages; `is_series`: every one of them is drawn."""

    topic: Topic[Any]
    take: Callable[[Any], None]
    is_series: bool = False


def feeds(core: Visualizer, arm: ArmDescription, cameras: Sequence[str]) -> list[Feed]:
    """Everything that the view of `arm` and of its cameras shows."""

    def on_gripper(state: GripperState) -> None:
        core.scene.on_jaws(jaw_objects(arm, jaws_apart(arm, state)))

    found = [
        Feed(JOINT_STATES, core.on_joint_state, True),
        Feed(JOINT_COMMANDS, core.on_joint_command, True),
        Feed(STEP_ERRORS, core.on_step_errors, True),
        Feed(DEVICE_STATE, core.on_device_state, True),
        Feed(DEVICE_STATUS, core.on_device_status),
        Feed(DEVICE_EVENTS, core.event_log.on_event),
        Feed(SENSORS, core.on_sensors),
        Feed(DEVICE_SHAFT, core.on_shaft, True),
        Feed(STEP_LEDGER, core.on_step_ledger),
        Feed(STOPPING_DISTANCE, core.on_stopping_distance),
        Feed(CONTROL, core.on_control),
        Feed(PLANNED_PATH, core.on_planned_path),
        Feed(SCENE, core.scene.on_scene),
        Feed(GRIPPER_STATE, on_gripper),
        Feed(CONTACTS, core.scene.on_contacts),
        Feed(LOG, core.event_log.on_log),
    ]
    for name in cameras:
        found += [
            Feed(camera_info(name), core.cameras.on_info),
            Feed(camera_image(name), core.cameras.on_image),
            Feed(camera_detections(name), core.cameras.on_detections),
        ]
    return found
