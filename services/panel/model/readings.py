"""The newest of everything that the twin says, read without waiting: what is late is shown as late."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar

import gemelo
from gemelo.libraries.arm.model.jaws import jaw_objects, jaws_apart
from gemelo.libraries.runtime.scene_meshes import SceneMeshes
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.control import ControlState
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.planning import JogStatus, PlannedPath
from gemelo.schemas.reasons import Reason
from gemelo.schemas.scene import Contacts, PlanningScene, SceneObject
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import Topic
from gemelo.services.panel.model.pace import DrawPace

M = TypeVar("M", bound=Message)

LOG_LINES = 12  # chosen: what a person reads at one look
LATE = 0.5  # [s] a joint state older than that is not where the arm is


@dataclass(frozen=True)
class Readings:
    """One moment, as the page shows it."""

    joints: Mapping[str, float]  # [rad] or [m] measured
    age: float  # [s] of the joint state
    step_errors: Mapping[str, float]  # [steps]
    commanded: Mapping[str, float]  # [rad] or [m] what the path asks for
    state: DeviceState | None
    status: DeviceStatus | None
    sensors: Mapping[str, float]
    fault: Reason | None
    gripper: GripperState | None
    ledger: StepLedger | None
    stopping: StoppingDistance | None
    control: ControlState | None = None
    shaft: Mapping[str, int] = field(default_factory=dict)  # [steps] that the shafts have made; a virtual device knows

    @property
    def is_live(self) -> bool:
        return self.age < LATE

    @property
    def is_moving(self) -> bool:
        return self.state is not None and any(abs(speed) >= 1.0 for speed in self.state.velocity)


class BusReadings:
    """Subscriptions of one connection. Any thread may read."""

    def __init__(self, arm: gemelo.Arm, on_moved: Callable[[], object]) -> None:
        """`on_moved` is called with a joint state of which a picture is due."""
        node, topics = arm.node, gemelo.topics
        self._arm, self._on_moved, self.pace = arm, on_moved, DrawPace()
        self._joints, self._commands = Latest(topics.JOINT_STATES), self._shown(topics.JOINT_COMMANDS)
        node.subscribe(topics.JOINT_STATES, self._on_joints)
        self._shaft = self._shown(topics.DEVICE_SHAFT)
        self._errors, self._sensors = self._shown(topics.STEP_ERRORS), self._shown(topics.SENSORS)
        self._state, self._status = self._shown(topics.DEVICE_STATE), node.latest(topics.DEVICE_STATUS)
        self._scene, self._contacts = PlanningScene(), node.latest(topics.CONTACTS)
        node.subscribe(topics.SCENE, SceneMeshes(node, self._on_scene).on_scene)
        self._path, self._jog = node.latest(topics.PLANNED_PATH), self._shown(topics.JOG_STATUS)
        self._gripper = self._shown(topics.GRIPPER_STATE)
        self._ledger, self._stopping = self._shown(topics.STEP_LEDGER), self._shown(topics.STOPPING_DISTANCE)
        self._control = node.latest(topics.CONTROL)
        self._log: deque[LogRecord] = deque(maxlen=LOG_LINES)
        node.subscribe(topics.LOG, self._log.append)

    def read(self) -> Readings:
        """Everything that has a value for every joint, now."""
        errors = self._errors.message
        commands, sensors = self._commands.message, self._sensors.message
        state, shaft = self._state.message, self._shaft.message
        return Readings(
            joints=self.joints,
            age=self._joints.age(),
            step_errors=dict(zip(errors.name, errors.error, strict=False)) if errors is not None else {},
            commanded=dict(zip(commands.name, commands.position, strict=False)) if commands is not None else {},
            state=state if not self._state.is_stale else None,
            status=self._status.message,
            sensors=dict(zip(sensors.name, sensors.value, strict=False))
            if sensors is not None and not self._sensors.is_stale
            else {},
            fault=fault_reason(state.fault, state.fault_joint) if state is not None else None,
            gripper=self._gripper.message if not self._gripper.is_stale else None,
            ledger=self._ledger.message if not self._ledger.is_stale else None,
            stopping=self._stopping.message if not self._stopping.is_stale else None,
            control=self._control.message,
            shaft=dict(zip(shaft.name, shaft.shaft, strict=False)) if shaft and not self._shaft.is_stale else {},
        )

    def _shown(self, topic: Topic[M]) -> Latest[M]:
        """What comes fifty times a second, and is shown five times."""
        return self._arm.node.latest(topic, on_demand=True)

    def _on_scene(self, scene: PlanningScene) -> None:
        self._scene = scene

    def _on_joints(self, state: JointState) -> None:
        self._joints.on_message(state)
        if self.pace.is_due(state.position, time.monotonic()):
            self._on_moved()

    @property
    def is_live(self) -> bool:
        """True while joint states come."""
        return self._joints.age() < LATE

    @property
    def joints(self) -> Mapping[str, float]:
        """[rad] or [m] measured, by joint."""
        state = self._joints.message
        return dict(zip(state.name, state.position, strict=False)) if state is not None else {}

    @property
    def scene(self) -> PlanningScene:
        """The newest planning scene, with the files of its meshes as far as they have come."""
        return self._scene

    @property
    def jaws(self) -> tuple[SceneObject, ...]:
        """The gripper's jaws, as far apart as they are; none before the first word of them."""
        state = self._gripper.message
        return () if state is None else jaw_objects(self._arm.description, jaws_apart(self._arm.description, state))

    @property
    def contacts(self) -> Contacts:
        """What touches where a plan was refused last."""
        return self._contacts.message or Contacts()

    @property
    def planned_path(self) -> PlannedPath:
        """The newest plan of anybody."""
        return self._path.message or PlannedPath()

    @property
    def jog_status(self) -> JogStatus | None:
        """What slows the jogging, of the last second."""
        return self._jog.message if self._jog.age() < 1.0 else None

    @property
    def log(self) -> tuple[LogRecord, ...]:
        """The last lines of every node's log, oldest first."""
        return tuple(self._log.copy())
