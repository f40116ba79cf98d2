"""The one table of the bus: every key, its message, rate, delivery, whether it is recorded, and who writes it.

Keys are relative to the robot: on the network they stand under `<robot>/`. A LATCHED message of another node than its
writer is dropped by every reader.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

from gemelo.schemas.camera import CameraImage, CameraInfo, CameraStatus
from gemelo.schemas.cell import CellTexts
from gemelo.schemas.control import ControlAnswer, ControlGive, ControlJoin, ControlState, ControlTake
from gemelo.schemas.detections import Detections
from gemelo.schemas.device import (
    CommandAck,
    CommandChunk,
    ConfigureRequest,
    ConfigureResponse,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceConfiguration,
    DeviceEvent,
    DeviceState,
    DeviceStatus,
    DeviceStopRequest,
    EchoRequest,
    EchoResponse,
    GatewayInputs,
    InjectRequest,
    InjectResponse,
    SensorReadings,
    ShaftPositions,
    StopKind,
)
from gemelo.schemas.frames import FrameTransforms, RobotDescription
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult, GripperState
from gemelo.schemas.joints import JointState, JointTargets, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from gemelo.schemas.planning import (
    AnswerInputs,
    FkRequest,
    FkResponse,
    IkRequest,
    IkResponse,
    JogCommand,
    JogInputs,
    JogStatus,
    PlanCancel,
    PlanCancelResult,
    PlanInputs,
    PlannedPath,
    PlanProgress,
    PlanRequest,
    PlanResponse,
    ValidityRequest,
    ValidityResponse,
)
from gemelo.schemas.scene import Contacts, PlanningScene, SceneMesh, SceneRequest, SceneResponse
from gemelo.schemas.system import LogRecord, NodeStatistics, ParameterChange

M_co = TypeVar("M_co", bound=Message, covariant=True)
Q_co = TypeVar("Q_co", bound=Message, covariant=True)
R_co = TypeVar("R_co", bound=Message, covariant=True)
G_co = TypeVar("G_co", bound=Message, covariant=True)
F_co = TypeVar("F_co", bound=Message, covariant=True)


class Delivery(Enum):
    """The delivery of a message: which losses are acceptable."""

    LATEST = "latest"  # the newest wins; older ones may be dropped
    EVERY = "every"  # reliable and in order
    LATCHED = "latched"  # reliable, and a late joiner gets the last one


@dataclass(frozen=True)
class Topic(Generic[M_co]):
    """A row of the table."""

    key: str
    message: type[M_co]
    delivery: Delivery
    rate: float | None  # [Hz]; None: when there is something to say
    recorded: bool
    writer: str  # node name; "any" where several may write
    about: str


@dataclass(frozen=True)
class Request(Generic[Q_co, R_co]):
    """A question with one answer."""

    key: str
    request: type[Q_co]
    response: type[R_co]
    server: str
    about: str
    urgent: bool = False  # sent, read and handled before all that waits; equal ones that wait are handled once
    recorded: bool = True  # its server publishes each question with its answer
    first: Q_co | None = None  # of an urgent one: this question is read and handled before all other urgent ones


@dataclass(frozen=True)
class Action(Generic[G_co, F_co, R_co]):
    """A long-running goal with feedback, a result and a cancel."""

    key: str
    goal: type[G_co]
    feedback: type[F_co]
    result: type[R_co]
    server: str
    about: str


LATEST, EVERY, LATCHED = Delivery.LATEST, Delivery.EVERY, Delivery.LATCHED
GATEWAY, CAMERA, ANY = "stepper_gateway", "camera", "any"

DESCRIPTION = Topic(
    "description", RobotDescription, LATCHED, None, True, "state_publisher", "URDF, SRDF and robot.toml"
)
JOINT_STATES = Topic("joint_states", JointState, LATEST, 50.0, True, GATEWAY, "what the joints did: executed steps")
JOINT_COMMANDS = Topic(
    "joint_commands", JointState, LATEST, 50.0, True, GATEWAY, "what the path asks for at the same instant"
)
STEP_ERRORS = Topic("step_errors", StepErrors, LATEST, 50.0, True, GATEWAY, "commanded minus executed, in steps")
STEP_LEDGER = Topic(
    "step_ledger", StepLedger, LATEST, 5.0, True, GATEWAY, "verified steps, and the confidence that none is lost"
)
STOPPING_DISTANCE = Topic(
    "stopping_distance", StoppingDistance, LATEST, 10.0, True, GATEWAY, "how far the tool goes if all is lost now"
)
JOINT_TARGETS = Topic(
    "joint_targets", JointTargets, LATEST, None, True, ANY, "streamed targets from a slider or script"
)
FRAMES = Topic("frames", FrameTransforms, LATEST, 50.0, True, "state_publisher", "poses of the moving links")
STATIC_FRAMES = Topic(
    "static_frames", FrameTransforms, LATCHED, None, True, "state_publisher", "poses of the fixed links"
)
PLANNED_PATH = Topic("planned_path", PlannedPath, LATCHED, None, True, "planner", "the tool's planned way")
PLAN_PROGRESS = Topic(  # EVERY: several plans share the key, and the newest of one must not push out another's
    "plan/progress", PlanProgress, EVERY, None, True, "planner", "how each plan stands that takes longer than 0.1 s"
)
PLAN_INPUTS = Topic(
    "plan/inputs", PlanInputs, EVERY, None, True, "planner", "what the next answer was made from, for `gemelo replay`"
)
ANSWER_INPUTS = Topic(
    "answer/inputs", AnswerInputs, EVERY, None, True, "planner", "what answers to ik, fk, ... and edits were made from"
)
SCENE = Topic("scene", PlanningScene, LATCHED, None, True, "planner", "what stands around the arm and what it carries")
CONTACTS = Topic("contacts", Contacts, LATCHED, None, True, "planner", "what touches where a plan was refused")
JOG = Topic("jog", JogCommand, LATEST, 50.0, True, ANY, "how to move now, by hand")
JOG_STATUS = Topic("jog_status", JogStatus, LATEST, None, True, "planner", "what slows the jogging")
JOG_INPUTS = Topic(
    "jog/inputs", JogInputs, EVERY, None, True, "planner", "what is jogged from, twice a second, for `gemelo replay`"
)
DEVICE_STATUS = Topic(
    "device/status", DeviceStatus, LATCHED, None, True, GATEWAY, "who the device is, and whether it is online"
)
DEVICE_STATE = Topic(
    "device/state", DeviceState, LATEST, 50.0, True, GATEWAY, "mode, steps, queue and time scale of the device"
)
DEVICE_EVENTS = Topic("device/events", DeviceEvent, EVERY, None, True, GATEWAY, "faults, under-runs, reconnections")
DEVICE_CONFIGURATION = Topic(
    "device/configuration", DeviceConfiguration, LATCHED, None, True, GATEWAY, "what robot.toml asks of the device"
)
SENSORS = Topic("sensors", SensorReadings, LATEST, 10.0, True, GATEWAY, "readings of the device, while they are fresh")
DEVICE_SHAFT = Topic(
    "device/shaft", ShaftPositions, LATEST, 10.0, True, GATEWAY, "a virtual device's true shafts beside its counters"
)
GRIPPER_STATE = Topic(
    "gripper_state", GripperState, LATEST, 10.0, True, GATEWAY, "the gripper's opening, and whether it presses"
)
CONTROL = Topic("control", ControlState, LATCHED, None, True, GATEWAY, "who alone may move the arm, if anybody")
COMMANDS = Topic("commands", CommandChunk, EVERY, None, True, GATEWAY, "every chunk of knots sent to the device")
COMMAND_ACKS = Topic("command_acks", CommandAck, EVERY, None, True, GATEWAY, "the device's answer to every chunk")
GATEWAY_INPUTS = Topic(
    "device/inputs", GatewayInputs, EVERY, None, True, GATEWAY, "all that the gateway's core was given, for a replay"
)
CELL = Topic("cell", CellTexts, LATCHED, None, True, CAMERA, "cell.toml and camera.toml: cameras, things and places")
LOG = Topic("log", LogRecord, EVERY, None, True, ANY, "the log of every node")
STATISTICS = Topic(
    "statistics", NodeStatistics, EVERY, None, True, ANY, "loop rate, losses and CPU of every node, 1 Hz"
)
PARAMETER_CHANGES = Topic(
    "parameters", ParameterChange, EVERY, None, True, ANY, "every parameter of a running node that is set"
)

TOPICS: tuple[Topic[Message], ...] = (
    DESCRIPTION, JOINT_STATES, JOINT_COMMANDS, STEP_ERRORS, JOINT_TARGETS, FRAMES, STATIC_FRAMES, PLANNED_PATH,
    PLAN_PROGRESS, PLAN_INPUTS, ANSWER_INPUTS, JOG_INPUTS,
    SCENE, CONTACTS, JOG, JOG_STATUS, DEVICE_STATUS, DEVICE_STATE, DEVICE_EVENTS, DEVICE_CONFIGURATION,
    SENSORS, DEVICE_SHAFT, GRIPPER_STATE, STEP_LEDGER, STOPPING_DISTANCE, CONTROL,
    COMMANDS, COMMAND_ACKS, GATEWAY_INPUTS, CELL, LOG, STATISTICS, PARAMETER_CHANGES,
)  # fmt: skip


def scene_mesh(digest: str) -> Topic[SceneMesh]:
    """The file of one mesh of the scene, which names it by this digest: a large file is not sent with every change."""
    return Topic(f"scene/mesh/{digest}", SceneMesh, LATCHED, None, False, "planner", "the file of a mesh of the scene")


# One of each for every camera of the cell file, by the camera's name.


def camera_image(camera: str) -> Topic[CameraImage]:
    """The newest image of a camera."""
    return Topic(f"camera/{camera}/image", CameraImage, LATEST, None, False, CAMERA, "what the camera sees")


def camera_info(camera: str) -> Topic[CameraInfo]:
    """What maps a camera's pixels to rays, and where it stands."""
    return Topic(f"camera/{camera}/info", CameraInfo, LATCHED, None, False, CAMERA, "its lens and where it stands")


def camera_status(camera: str) -> Topic[CameraStatus]:
    """How a camera is; latched, and repeated once a second."""
    return Topic(f"camera/{camera}/status", CameraStatus, LATCHED, None, True, CAMERA, "whether images come, or why")


def camera_detections(camera: str) -> Topic[Detections]:
    """What the detector has found in a camera's newest image."""
    about = "things found in its image"
    return Topic(f"camera/{camera}/detections", Detections, LATEST, None, True, "detector", about)


def camera_truth(camera: str) -> Topic[Detections]:
    """Where the things of a virtual camera's cell are in truth, once a second: what a detector is judged by."""
    about = "where a virtual camera has the things"
    return Topic(f"camera/{camera}/truth", Detections, LATEST, None, True, CAMERA, about)


CAMERA_TOPICS = (camera_image, camera_info, camera_status, camera_detections, camera_truth)

PLAN = Request("plan", PlanRequest, PlanResponse, "planner", "a goal in, a verified trajectory or a refusal out")
PLAN_CANCEL = Request("plan/cancel", PlanCancel, PlanCancelResult, "planner", "end a plan before its end")
IK = Request("ik", IkRequest, IkResponse, "planner", "joint values for a tool pose")
FK = Request("fk", FkRequest, FkResponse, "planner", "link poses for joint values")
STATE_VALIDITY = Request(
    "state_validity", ValidityRequest, ValidityResponse, "planner", "may the arm stand there, and what would touch"
)
SCENE_EDIT = Request("scene/edit", SceneRequest, SceneResponse, "planner", "add, remove, move, attach, allow ...")
DEVICE_COMMAND = Request(
    "device/command", DeviceCommandRequest, DeviceCommandResponse, GATEWAY,
    "resume, reset, reference, arm, home, output, speed",
)  # fmt: skip
DEVICE_STOP = Request(
    "device/stop",
    DeviceStopRequest,
    DeviceCommandResponse,
    GATEWAY,
    "stop, hold or disarm, before anything else",
    urgent=True,
    first=DeviceStopRequest(kind=StopKind.STOP),
)
DEVICE_CONFIGURE = Request(
    "device/configure", ConfigureRequest, ConfigureResponse, GATEWAY, "give the device its configuration anew"
)
DEVICE_INJECT = Request(
    "device/inject", InjectRequest, InjectResponse, GATEWAY, "inject inputs and failures into a virtual device"
)

DEVICE_ECHO = Request(
    "device/echo", EchoRequest, EchoResponse, GATEWAY, "what the wire to the device takes, there and back"
)

# Not recorded: the secret in them would stand in the recording, and on the key that tells of questions and answers.
CONTROL_TAKE = Request(
    "control/take", ControlTake, ControlAnswer, GATEWAY, "become the only one who may move the arm", recorded=False
)
CONTROL_JOIN = Request(
    "control/join", ControlJoin, ControlAnswer, GATEWAY, "move the arm too, with the holder's secret", recorded=False
)
CONTROL_GIVE = Request(
    "control/give", ControlGive, ControlAnswer, GATEWAY, "everybody may move the arm again", recorded=False
)

REQUESTS: tuple[Request[Message, Message], ...] = (
    PLAN,
    PLAN_CANCEL,
    IK,
    FK,
    STATE_VALIDITY,
    SCENE_EDIT,
    DEVICE_COMMAND,
    DEVICE_STOP,
    DEVICE_CONFIGURE,
    DEVICE_INJECT,
    DEVICE_ECHO,
    CONTROL_TAKE,
    CONTROL_JOIN,
    CONTROL_GIVE,
)

FOLLOW_JOINT_TRAJECTORY = Action(
    "follow_joint_trajectory", FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult,
    GATEWAY, "execute a trajectory to the step",
)  # fmt: skip

GRIPPER_COMMAND = Action(
    "gripper_command", GripperCommandGoal, GripperCommandFeedback, GripperCommandResult, GATEWAY,
    "open or close the gripper",
)  # fmt: skip

ACTIONS: tuple[Action[Message, Message, Message], ...] = (FOLLOW_JOINT_TRAJECTORY, GRIPPER_COMMAND)
