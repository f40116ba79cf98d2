"""The one table of the bus: every key, its message, rate, delivery, whether it is recorded, who writes and reads it.

A new topic is one row here and a verb: `publisher(ROW).put` where it is written, `subscribe(ROW, handler)` where it is
read. Permissions, recordings, the logger and the command line follow from the row. Keys are relative to the robot: on
the network they stand under `<robot>/`. A LATCHED message of another node than its writer is dropped by every reader.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

from gemelo.schemas import (
    camera,
    cell,
    control,
    detections,
    device,
    frames,
    gripper,
    joints,
    ledger,
    motion,
    planning,
    scene,
    system,
)  # fmt: skip
from gemelo.schemas.message import Message

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
    readers: tuple[str, ...] = ()  # services that may read it, beside those that read all: panel, logger, a person's
    rest_rate: float | None = None  # [Hz] while nothing in it changes, where that is less than `rate`


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
GATEWAY, STATE_PUBLISHER, PLANNER = "stepper_gateway", "state_publisher", "planner"
VISUALIZER, CAMERA, DETECTOR = "visualizer", "camera", "detector"
ROS_BRIDGE, ROS_OPERATOR = "ros_bridge", "ros_operator"  # the same process: it looks, or it moves the arm too
ANY = "any"
REST_RATE = 10.0  # [Hz] of what an arm at rest does; chosen: a fifth of the messages, and a person sees no difference
READINGS_REST_RATE = 2.0  # [Hz] of the readings beside it, while they are the same; chosen: no plan waits for them

# fmt: off
DESCRIPTION = Topic(
    "description", frames.RobotDescription, LATCHED, None, True, STATE_PUBLISHER, "URDF, SRDF and robot.toml",
    (VISUALIZER,),
)
JOINT_STATES = Topic(
    "joint_states", joints.JointState, LATEST, 50.0, True, GATEWAY, "what the joints did: executed steps",
    (PLANNER, STATE_PUBLISHER, VISUALIZER, CAMERA, DETECTOR), REST_RATE,
)
JOINT_COMMANDS = Topic(
    "joint_commands", joints.JointState, LATEST, 50.0, True, GATEWAY, "what the path asks for at the same instant",
    (VISUALIZER,), READINGS_REST_RATE,
)
STEP_ERRORS = Topic(
    "step_errors", joints.StepErrors, LATEST, 50.0, True, GATEWAY, "commanded minus executed, in steps", (VISUALIZER,),
    READINGS_REST_RATE,
)
STEP_LEDGER = Topic(
    "step_ledger", ledger.StepLedger, LATEST, 5.0, True, GATEWAY,
    "verified steps, and the confidence that none is lost", (VISUALIZER,), READINGS_REST_RATE,
)
STOPPING_DISTANCE = Topic(
    "stopping_distance", ledger.StoppingDistance, LATEST, 10.0, True, GATEWAY,
    "how far the tool goes if all is lost now", (VISUALIZER,), READINGS_REST_RATE,
)
JOINT_TARGETS = Topic(
    "joint_targets", joints.JointTargets, LATEST, None, True, ANY, "streamed targets from a slider or script",
    (GATEWAY,),
)
STREAM_PATHS = Topic(
    "stream/paths", planning.StreamPath, LATEST, None, False, GATEWAY, "paths of streamed targets, to be looked at",
    (PLANNER,),
)
STREAM_VERDICTS = Topic(
    "stream/verdicts", planning.StreamVerdict, LATEST, None, False, PLANNER, "whether they are free", (GATEWAY,),
)
FRAMES = Topic(
    "frames", frames.FrameTransforms, LATEST, 50.0, True, STATE_PUBLISHER, "poses of the moving links",
    rest_rate=REST_RATE,
)
STATIC_FRAMES = Topic(
    "static_frames", frames.FrameTransforms, LATCHED, None, True, STATE_PUBLISHER, "poses of the fixed links",
)
PLANNED_PATH = Topic(
    "planned_path", planning.PlannedPath, LATCHED, None, True, PLANNER, "the tool's planned path", (VISUALIZER,),
)
PLAN_PROGRESS = Topic(  # EVERY: several plans share the key, and the newest of one must not push out another's
    "plan/progress", planning.PlanProgress, EVERY, None, True, PLANNER,
    "how each plan stands that takes longer than 0.1 s",
)
PLAN_INPUTS = Topic(
    "plan/inputs", planning.PlanInputs, EVERY, None, True, PLANNER,
    "what the next answer was made from, for `gemelo replay`",
)
ANSWER_INPUTS = Topic(
    "answer/inputs", planning.AnswerInputs, EVERY, None, True, PLANNER,
    "what answers to ik, fk, ... and edits were made from",
)
SCENE = Topic(
    "scene", scene.PlanningScene, LATCHED, None, True, PLANNER, "what stands around the arm and what it carries",
    (GATEWAY, PLANNER, VISUALIZER, CAMERA),
)
CONTACTS = Topic(
    "contacts", scene.Contacts, LATCHED, None, True, PLANNER, "what touches where a plan was refused", (VISUALIZER,),
)
JOG = Topic("jog", planning.JogCommand, LATEST, 50.0, True, ANY, "how to move now, by hand", (PLANNER,))
POSE_TARGETS = Topic(
    "pose_targets", planning.PoseTarget, LATEST, None, True, ANY, "streamed poses of the tool", (PLANNER,),
)
JOG_STATUS = Topic("jog_status", planning.JogStatus, LATEST, None, True, PLANNER, "what slows the jogging")
JOG_INPUTS = Topic(
    "jog/inputs", planning.JogInputs, EVERY, None, True, PLANNER,
    "what is jogged from, twice a second, for `gemelo replay`",
)
DEVICE_STATUS = Topic(
    "device/status", device.DeviceStatus, LATCHED, None, True, GATEWAY, "who the device is, and whether it is online",
    (PLANNER, VISUALIZER),
)
DEVICE_STATE = Topic(
    "device/state", device.DeviceState, LATEST, 50.0, True, GATEWAY, "mode, steps, queue and time scale of the device",
    (VISUALIZER,), REST_RATE,
)
DEVICE_EVENTS = Topic(
    "device/events", device.DeviceEvent, EVERY, None, True, GATEWAY, "faults, under-runs, reconnections", (VISUALIZER,),
)
DEVICE_CONFIGURATION = Topic(
    "device/configuration", device.DeviceConfiguration, LATCHED, None, True, GATEWAY,
    "what robot.toml asks of the device",
)
SENSORS = Topic(
    "sensors", device.SensorReadings, LATEST, 10.0, True, GATEWAY, "readings of the device, while they are fresh",
    (VISUALIZER,), READINGS_REST_RATE,
)
DEVICE_SHAFT = Topic(
    "device/shaft", device.ShaftPositions, LATEST, 10.0, True, GATEWAY,
    "a virtual device's true shafts beside its counters", (VISUALIZER,), READINGS_REST_RATE,
)
GRIPPER_STATE = Topic(
    "gripper_state", gripper.GripperState, LATEST, 10.0, True, GATEWAY, "the gripper's opening, and whether it presses",
    (PLANNER, VISUALIZER, CAMERA), READINGS_REST_RATE,
)
CONTROL = Topic(
    "control", control.ControlState, LATCHED, None, True, GATEWAY, "who alone may move the arm, if anybody",
    (PLANNER, VISUALIZER),
)
COMMANDS = Topic("commands", device.CommandChunk, EVERY, None, True, GATEWAY, "every chunk of knots sent to the device")
COMMAND_ACKS = Topic(
    "command_acks", device.CommandAck, EVERY, None, True, GATEWAY, "the device's answer to every chunk",
)
GATEWAY_INPUTS = Topic(
    "device/inputs", device.GatewayInputs, EVERY, None, True, GATEWAY,
    "all that the gateway's core was given, for a replay",
)
CELL = Topic(
    "cell", cell.CellTexts, LATCHED, None, True, CAMERA, "cell.toml and camera.toml: cameras, things and places",
)
LOG = Topic("log", system.LogRecord, EVERY, None, True, ANY, "the log of every node", (VISUALIZER,))
STATISTICS = Topic(
    "statistics", system.NodeStatistics, EVERY, None, True, ANY, "loop rate, losses and CPU of every node, 1 Hz",
)
PARAMETER_CHANGES = Topic(
    "parameters", system.ParameterChange, EVERY, None, True, ANY, "every parameter of a running node that is set",
)
# fmt: on


def scene_mesh(digest: str) -> Topic[scene.SceneMesh]:
    """The file of one mesh of the scene, which names it by this digest: a large file is not sent with every change."""
    key, about = f"scene/mesh/{digest}", "the file of a mesh of the scene"
    return Topic(key, scene.SceneMesh, LATCHED, None, False, PLANNER, about, (VISUALIZER, CAMERA))


EXCHANGES = "@request/"  # before the key of a request: its questions, each with its answer


def exchange_topic(request: Request[Message, Message]) -> Topic[system.Exchange]:
    """A request travels between two nodes only, so its server publishes each question with its answer."""
    about = f"questions of {request.key}, each with its answer"
    return Topic(EXCHANGES + request.key, system.Exchange, EVERY, None, request.recorded, request.server, about)


# One of each for every camera of the cell file, by the camera's name.


def camera_image(name: str) -> Topic[camera.CameraImage]:
    """The newest image of a camera."""
    key, readers = f"camera/{name}/image", (VISUALIZER, DETECTOR)
    return Topic(key, camera.CameraImage, LATEST, None, False, CAMERA, "what the camera sees", readers)


def camera_info(name: str) -> Topic[camera.CameraInfo]:
    """What maps a camera's pixels to rays, and where it stands."""
    key, readers = f"camera/{name}/info", (VISUALIZER, DETECTOR)
    return Topic(key, camera.CameraInfo, LATCHED, None, False, CAMERA, "its lens and where it stands", readers)


def camera_status(name: str) -> Topic[camera.CameraStatus]:
    """How a camera is; latched, and repeated once a second."""
    key, about = f"camera/{name}/status", "whether images come, or why"
    return Topic(key, camera.CameraStatus, LATCHED, None, True, CAMERA, about)


def camera_detections(name: str) -> Topic[detections.Detections]:
    """What the detector has found in a camera's newest image."""
    key, about = f"camera/{name}/detections", "things found in its image"
    return Topic(key, detections.Detections, LATEST, None, True, DETECTOR, about, (VISUALIZER,))


def camera_truth(name: str) -> Topic[detections.Detections]:
    """Where the things of a virtual camera's cell are in truth, once a second: what a detector is judged by."""
    key, about = f"camera/{name}/truth", "where a virtual camera has the things"
    return Topic(key, detections.Detections, LATEST, None, True, CAMERA, about)


CAMERA_TOPICS = (camera_image, camera_info, camera_status, camera_detections, camera_truth)

# fmt: off
PLAN = Request(
    "plan", planning.PlanRequest, planning.PlanResponse, PLANNER, "a goal in, a verified trajectory or a refusal out",
)
PLAN_CANCEL = Request(
    "plan/cancel", planning.PlanCancel, planning.PlanCancelResult, PLANNER, "end a plan before its end",
)
IK = Request("ik", planning.IkRequest, planning.IkResponse, PLANNER, "joint values for a tool pose")
FK = Request("fk", planning.FkRequest, planning.FkResponse, PLANNER, "link poses for joint values")
STATE_VALIDITY = Request(
    "state_validity", planning.ValidityRequest, planning.ValidityResponse, PLANNER,
    "may the arm stand there, and what would touch",
)
SCENE_EDIT = Request(
    "scene/edit", scene.SceneRequest, scene.SceneResponse, PLANNER, "add, remove, move, attach, allow ...",
)
DEVICE_COMMAND = Request(
    "device/command", device.DeviceCommandRequest, device.DeviceCommandResponse, GATEWAY,
    "resume, reset, reference, arm, home, output, speed",
)
DEVICE_STOP = Request(
    "device/stop", device.DeviceStopRequest, device.DeviceCommandResponse, GATEWAY,
    "stop, hold or disarm, before anything else", urgent=True,
    first=device.DeviceStopRequest(kind=device.StopKind.STOP),
)
DEVICE_CONFIGURE = Request(
    "device/configure", device.ConfigureRequest, device.ConfigureResponse, GATEWAY,
    "give the device its configuration anew",
)
DEVICE_INJECT = Request(
    "device/inject", device.InjectRequest, device.InjectResponse, GATEWAY,
    "inject inputs and failures into a virtual device",
)
DEVICE_ECHO = Request(
    "device/echo", device.EchoRequest, device.EchoResponse, GATEWAY,
    "what the wire to the device takes, there and back",
)

# Not recorded: the secret in them would stand in the recording, and on the key that tells of questions and answers.
CONTROL_TAKE = Request(
    "control/take", control.ControlTake, control.ControlAnswer, GATEWAY, "become the only one who may move the arm",
    recorded=False,
)
CONTROL_JOIN = Request(
    "control/join", control.ControlJoin, control.ControlAnswer, GATEWAY, "move the arm too, with the holder's secret",
    recorded=False,
)
CONTROL_GIVE = Request(
    "control/give", control.ControlGive, control.ControlAnswer, GATEWAY, "everybody may move the arm again",
    recorded=False,
)

FOLLOW_JOINT_TRAJECTORY = Action(
    "follow_joint_trajectory", motion.FollowJointTrajectoryGoal, motion.FollowJointTrajectoryFeedback,
    motion.FollowJointTrajectoryResult, GATEWAY, "execute a trajectory to the step",
)
GRIPPER_COMMAND = Action(
    "gripper_command", gripper.GripperCommandGoal, gripper.GripperCommandFeedback, gripper.GripperCommandResult,
    GATEWAY, "open or close the gripper",
)
# fmt: on

TOPICS: tuple[Topic[Message], ...] = tuple(row for row in [*globals().values()] if isinstance(row, Topic))
REQUESTS: tuple[Request[Message, Message], ...] = tuple(
    row for row in [*globals().values()] if isinstance(row, Request)
)
ACTIONS: tuple[Action[Message, Message, Message], ...] = tuple(
    row for row in [*globals().values()] if isinstance(row, Action)
)
