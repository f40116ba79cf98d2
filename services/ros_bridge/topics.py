"""The topics of the node: ours come in, and go out as messages of ROS 2."""

from __future__ import annotations

from typing import Any, Protocol

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.ros2 import messages
from gemelo.libraries.ros2.markers import MARKERS, path_markers, scene_markers
from gemelo.libraries.ros2.types import encode, ros_type
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.names import DEFAULT, LATCHED, Qos, RosType
from gemelo.libraries.runtime.ros_wire.names import FRAMES as FRAMES_QOS
from gemelo.libraries.runtime.ros_wire.ros_node import RosPublication
from gemelo.schemas.deployment import RosMeshes, RosSection
from gemelo.schemas.frames import FrameTransform, FrameTransforms, RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.reasons import Reason
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import (
    DESCRIPTION,
    DEVICE_STATE,
    DEVICE_STATUS,
    FRAMES,
    JOINT_STATES,
    LOG,
    PLANNED_PATH,
    SCENE,
    STATIC_FRAMES,
    STEP_ERRORS,
)
from gemelo.services.ros_bridge.meshes import MeshServer, served_as

LOG_QOS = Qos(100, is_latched=True)  # of /rosout; chosen: what a console shows, a tenth of what rcl keeps
STRING, JOINTS, TRANSFORMS = "std_msgs/msg/String", "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage"
SLACK = 0.002  # [s] that a message may come too early and yet be sent
RELEVANT = 20  # the least level of a log record that goes out


class Publishing(Protocol):
    """A node of ROS 2, as far as topics need it."""

    def publisher(self, name: str, kind: RosType, qos: Qos = DEFAULT) -> RosPublication: ...


class Topics:
    """Everything that the bridge publishes of its own accord."""

    def __init__(self, node: Node, ros: Publishing, section: RosSection, arm: ArmDescription) -> None:
        self._node, self._section = node, section
        self.prefix = f"{section.namespace}/" if section.namespace else ""
        self._static: tuple[FrameTransform, ...] = ()
        self._cameras: dict[str, FrameTransform] = {}  # by their names
        self._folder, self._base = arm.folder, arm.base_frame
        self._meshes: MeshServer | None = None
        self.refusal: Reason | None = None  # of the last goal of ROS, where it was refused
        self._joint_states = ros.publisher("joint_states", ros_type(JOINTS))
        self._tf = ros.publisher("/tf", ros_type(TRANSFORMS), FRAMES_QOS)
        self._tf_static = ros.publisher("/tf_static", ros_type(TRANSFORMS), LATCHED)
        self._description = ros.publisher("robot_description", ros_type(STRING), LATCHED)
        self._semantic = ros.publisher("robot_description_semantic", ros_type(STRING), LATCHED)
        self._scene = ros.publisher("~/scene", ros_type(MARKERS), LATCHED)
        self._path = ros.publisher("~/planned_path", ros_type(MARKERS), LATCHED)
        self._diagnostics = ros.publisher("/diagnostics", ros_type("diagnostic_msgs/msg/DiagnosticArray"))
        self._rosout = ros.publisher("/rosout", ros_type("rcl_interfaces/msg/Log"), LOG_QOS)
        self._status, self._state = node.latest(DEVICE_STATUS), node.latest(DEVICE_STATE, on_demand=True)
        self._errors = node.latest(STEP_ERRORS, on_demand=True)
        self._last_joints, self._last_frames = Pace(section.rate), Pace(section.rate)
        self.joints: JointState | None = None  # the newest
        node.subscribe(JOINT_STATES, self._on_joint_state)
        node.subscribe(FRAMES, self._on_frames)
        node.subscribe(STATIC_FRAMES, self._on_static_frames)
        node.subscribe(DESCRIPTION, self._on_description)
        node.subscribe(SCENE, self._on_scene)
        node.subscribe(PLANNED_PATH, self._on_path)
        node.subscribe(LOG, self._on_log, own=True)

    def publish_diagnostics(self) -> None:
        """How device and steps are; call once a second."""
        now = self._node.now()
        message = messages.diagnostics(
            now, self._node.robot, self._status.message, self._state.message, self._errors.message, self.refusal
        )
        self._put(self._diagnostics, message, now)

    def _on_joint_state(self, state: JointState) -> None:
        self.joints = state
        if self._last_joints.is_due(state.stamp):
            self._put(self._joint_states, messages.joint_state(state), state.stamp)

    def _on_frames(self, frames: FrameTransforms) -> None:
        stamp = max((each.stamp for each in frames.transforms), default=0)
        if self._last_frames.is_due(stamp):
            self._put(self._tf, messages.frames(frames, self.prefix), stamp)

    def _on_static_frames(self, frames: FrameTransforms) -> None:
        self._static = frames.transforms
        self._publish_static()

    def add_static(self, frame: FrameTransform) -> None:
        """A camera's frame; all static ones are in one message, the last that a late joiner gets."""
        self._cameras[frame.child] = frame
        self._publish_static()

    def _publish_static(self) -> None:
        whole = FrameTransforms(transforms=(*self._static, *self._cameras.values()))
        self._put(self._tf_static, messages.frames(whole, self.prefix), self._node.now())

    def _on_description(self, description: RobotDescription) -> None:
        urdf = self._with_meshes(description.urdf)
        self._put(self._description, messages.string(urdf), self._node.now())
        self._put(self._semantic, messages.string(description.srdf), self._node.now())

    def _with_meshes(self, urdf: str) -> str:
        match self._section.meshes:
            case RosMeshes.HTTP:
                self.close()
                server = self._meshes = MeshServer(urdf, self._folder)
                return messages.urdf_with_meshes(urdf, lambda each: f"{server.base}/{served_as(each)}")
            case RosMeshes.FILE:
                return messages.urdf_with_meshes(urdf, lambda each: (self._folder / each).as_uri())
        return urdf

    def close(self) -> None:
        """Serves no mesh any more."""
        server, self._meshes = self._meshes, None
        if server is not None:
            server.close()

    def _on_scene(self, scene: PlanningScene) -> None:
        self._put(self._scene, scene_markers(scene, self._base, self.prefix), self._node.now())

    def _on_path(self, path: PlannedPath) -> None:
        self._put(self._path, path_markers(path, self._base, self.prefix), self._node.now())

    def _on_log(self, record: LogRecord) -> None:
        if record.level >= RELEVANT:
            self._put(self._rosout, messages.log_record(record), record.stamp)

    def _put(self, publication: RosPublication, message: Any, stamp: int) -> None:
        publication.put(encode(message), stamp)


class Pace:
    """Which of the messages go out, where not all of them do."""

    def __init__(self, rate: float) -> None:
        """At most `rate` [Hz]; 0: all."""
        self._period = int((1.0 / rate - SLACK) * messages.SECOND) if rate else 0
        self._last = 0

    def is_due(self, stamp: int) -> bool:
        """`stamp` [ns] of the message."""
        if stamp - self._last < self._period:
            return False
        self._last = stamp
        return True
