"""Roles: who may say and hear what on the bus, beside what schemas/topics.py says of writers, readers and servers.

A role is the common name of a certificate. The nodes of a role write the topics and serve the requests and actions
that the table of topics gives to their names; here stands what else the role may do.
"""

from __future__ import annotations

from dataclasses import dataclass

from gemelo.schemas.message import Message
from gemelo.schemas.topics import (
    ACTIONS,
    ANY,
    CAMERA,
    CAMERA_TOPICS,
    CONTROL,
    CONTROL_GIVE,
    CONTROL_JOIN,
    CONTROL_TAKE,
    DESCRIPTION,
    DETECTOR,
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_ECHO,
    DEVICE_EVENTS,
    DEVICE_INJECT,
    DEVICE_STATE,
    DEVICE_STATUS,
    DEVICE_STOP,
    FK,
    FRAMES,
    GATEWAY,
    GRIPPER_STATE,
    IK,
    JOG,
    JOINT_STATES,
    JOINT_TARGETS,
    LOG,
    PARAMETER_CHANGES,
    PLAN,
    PLAN_CANCEL,
    PLANNED_PATH,
    PLANNER,
    POSE_TARGETS,
    REQUESTS,
    ROS_BRIDGE,
    ROS_OPERATOR,
    SCENE,
    SCENE_EDIT,
    STATE_PUBLISHER,
    STATE_VALIDITY,
    STATIC_FRAMES,
    STATISTICS,
    STEP_ERRORS,
    TOPICS,
    VISUALIZER,
    Action,
    Request,
    Topic,
    scene_mesh,
)

AnyTopic = Topic[Message]
AnyRequest = Request[Message, Message]
AnyAction = Action[Message, Message, Message]


@dataclass(frozen=True)
class Role:
    """A row of the table of roles."""

    name: str
    about: str
    node: str = ""  # the one node of this role; empty: any name that no service has
    writes: tuple[AnyTopic, ...] = ()  # of the topics that `any` may write, beside its log and its statistics
    reads: tuple[AnyTopic, ...] = ()
    asks: tuple[AnyRequest, ...] = ()
    acts: tuple[AnyAction, ...] = ()  # sends, follows and cancels goals
    watches: tuple[AnyAction, ...] = ()  # hears how goals stand
    sets_parameters: bool = False
    hears_requests: bool = False  # the questions of others, each with its answer, and how every goal went


BY_EVERY_NODE: tuple[AnyTopic, ...] = (LOG, STATISTICS, PARAMETER_CHANGES)
BY_HAND: tuple[AnyTopic, ...] = (JOG, POSE_TARGETS, JOINT_TARGETS)
EACH_CAMERA = "*"  # in a key: the name of any camera
OF_CAMERAS: tuple[AnyTopic, ...] = tuple(make(EACH_CAMERA) for make in CAMERA_TOPICS)
MESHES: tuple[AnyTopic, ...] = (scene_mesh("*"),)  # of the scene, whatever their digests are
EVERYTHING: tuple[AnyTopic, ...] = (*TOPICS, *MESHES, *OF_CAMERAS)
RECORDED = (*(topic for topic in TOPICS if topic.recorded), *MESHES, *OF_CAMERAS)


def read_by(node: str) -> tuple[AnyTopic, ...]:
    """The topics that the table gives to a service to read; in those of cameras `EACH_CAMERA` stands for the camera."""
    return tuple(topic for topic in EVERYTHING if node in topic.readers)


STOPS: tuple[AnyRequest, ...] = (DEVICE_STOP,)  # whoever may connect may stop the arm
LOOKS: tuple[AnyRequest, ...] = (IK, FK, STATE_VALIDITY)  # answers that change nothing
CONTROLS: tuple[AnyRequest, ...] = (CONTROL_TAKE, CONTROL_JOIN, CONTROL_GIVE)
SEEN_FROM_ROS: tuple[AnyTopic, ...] = (
    DESCRIPTION, JOINT_STATES, FRAMES, STATIC_FRAMES, DEVICE_STATUS, DEVICE_STATE, DEVICE_EVENTS, STEP_ERRORS,
    GRIPPER_STATE, CONTROL, SCENE, PLANNED_PATH, LOG, *OF_CAMERAS,
)  # fmt: skip
MOVES: tuple[AnyRequest, ...] = (PLAN, PLAN_CANCEL, SCENE_EDIT, DEVICE_COMMAND, *CONTROLS)

ROLES: tuple[Role, ...] = (
    Role("gateway", "trajectories to step knots", GATEWAY, reads=read_by(GATEWAY)),
    Role(
        "planner", "goals to verified trajectories, and jogging", PLANNER,
        writes=(JOINT_TARGETS,), reads=read_by(PLANNER), asks=STOPS,
    ),
    Role(
        "state_publisher", "joint states to frames", STATE_PUBLISHER, reads=read_by(STATE_PUBLISHER), asks=STOPS,
    ),
    Role("logger", "everything recorded to files", "logger", reads=RECORDED, asks=STOPS, hears_requests=True),
    Role(
        "visualizer", "everything that is seen to Rerun", VISUALIZER, reads=read_by(VISUALIZER), asks=STOPS,
    ),
    Role("camera", "the images of all cameras", CAMERA, reads=read_by(CAMERA), asks=STOPS),
    Role("detector", "what is in the images", DETECTOR, reads=read_by(DETECTOR), asks=STOPS),
    Role("ros_bridge", "the arm as a node of ROS 2", ROS_BRIDGE, reads=SEEN_FROM_ROS, asks=STOPS),
    Role(
        "ros_operator", "the same, where ROS 2 may move the arm", ROS_OPERATOR,
        writes=(JOG,), reads=SEEN_FROM_ROS, asks=(*STOPS, *LOOKS, DEVICE_COMMAND, *CONTROLS), acts=ACTIONS,
    ),
    Role(
        "panel", "the operator's page", "panel",
        writes=BY_HAND, reads=EVERYTHING, asks=(*STOPS, *LOOKS, *MOVES, DEVICE_CONFIGURE, DEVICE_INJECT), acts=ACTIONS,
    ),
    Role(
        "operator", "a person who moves the arm and sets parameters",
        writes=BY_HAND, reads=EVERYTHING, asks=REQUESTS, acts=ACTIONS, sets_parameters=True, hears_requests=True,
    ),
    Role("viewer", "a person who only looks, and may stop", reads=EVERYTHING, asks=(*STOPS, *LOOKS), watches=ACTIONS),
    Role(
        "script", "a program that moves the arm",
        writes=BY_HAND, reads=EVERYTHING, asks=(*STOPS, *LOOKS, *MOVES, DEVICE_ECHO), acts=ACTIONS,
    ),
)  # fmt: skip

ROLE_OF_NODE = {role.node: role.name for role in ROLES if role.node}  # names that only their role may bear
SERVICES = tuple(sorted(ROLE_OF_NODE))


def role(name: str) -> Role:
    """The role of that name; raises `KeyError`."""
    return {each.name: each for each in ROLES}[name]


def written_by(role: Role) -> tuple[AnyTopic, ...]:
    """The topics that a role may publish; in those of cameras `EACH_CAMERA` stands for the camera."""
    own = tuple(topic for topic in EVERYTHING if topic.writer != ANY and topic.writer == role.node)
    return (*own, *role.writes, *BY_EVERY_NODE)


def served_by(role: Role) -> tuple[AnyRequest, ...]:
    """The requests of the table that a role may answer; its node's requests about itself come in addition."""
    return tuple(request for request in REQUESTS if role.node and request.server == role.node)


def carried_out_by(role: Role) -> tuple[AnyAction, ...]:
    """The actions that a role may serve."""
    return tuple(action for action in ACTIONS if role.node and action.server == role.node)
