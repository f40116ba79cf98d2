"""The types of ROS 2 of the bridge: one table of definitions with their hashes, and the store that encodes messages.

A hash is part of every key (libraries/runtime/ros_wire/names.py): another definition is another key. The definitions
that rosbags has are its own; the tables add services and actions. Only the feedback of FollowJointTrajectory differs
between control_msgs 5 (Jazzy) and from 6.3 on (Kilted, Lyrical, Rolling), so that there are two of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from functools import cache
from typing import Any

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from gemelo.libraries.runtime.ros_wire.names import RosType

MOST_ELEMENTS = 1_000_000  # of a sequence that is decoded; chosen: ten times the most points of a trajectory
EMPTY = "uint8 structure_needs_at_least_one_member"  # of rosidl, where a definition has no field

MESSAGES = {
    # rosbags has `char[16] client_gid`, of which rosidl makes uint8 before it hashes.
    "service_msgs/msg/ServiceEventInfo":
        "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number",
    "control_msgs/msg/JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration",
    "control_msgs/msg/JointComponentTolerance":
        "string joint_name\nuint16 component\nfloat64 position\nfloat64 velocity\nfloat64 acceleration",
    "control_msgs/msg/JointJog":
        "std_msgs/Header header\nstring[] joint_names\nfloat64[] displacements\nfloat64[] velocities\nfloat64 duration",
    "control_msgs/msg/GripperCommand": "float64 position\nfloat64 max_effort",
}  # fmt: skip
SERVICES = {  # request and response
    "std_srvs/srv/Trigger": (EMPTY, "bool success\nstring message"),
    "action_msgs/srv/CancelGoal":
        ("action_msgs/GoalInfo goal_info", "int8 return_code\naction_msgs/GoalInfo[] goals_canceling"),
    "rcl_interfaces/srv/ListParameters":
        ("string[] prefixes\nuint64 depth", "rcl_interfaces/ListParametersResult result"),
    "rcl_interfaces/srv/GetParameters": ("string[] names", "rcl_interfaces/ParameterValue[] values"),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
    "rcl_interfaces/srv/DescribeParameters": ("string[] names", "rcl_interfaces/ParameterDescriptor[] descriptors"),
    "rcl_interfaces/srv/SetParameters":
        ("rcl_interfaces/Parameter[] parameters", "rcl_interfaces/SetParametersResult[] results"),
    "rcl_interfaces/srv/SetParametersAtomically":
        ("rcl_interfaces/Parameter[] parameters", "rcl_interfaces/SetParametersResult result"),
}  # fmt: skip
FOLLOW, GRIPPER = "control_msgs/action/FollowJointTrajectory", "control_msgs/action/GripperCommand"
GRIPPED = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal"
PROGRESS = (
    "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint desired\n"
    "trajectory_msgs/JointTrajectoryPoint actual\ntrajectory_msgs/JointTrajectoryPoint error{index}\n"
    "string[] multi_dof_joint_names\ntrajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired\n"
    "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual\n"
    "trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error{multi_dof_index}"
)
ACTIONS = {  # goal, result and feedback, each name in full
    FOLLOW: (
        "trajectory_msgs/JointTrajectory trajectory\ntrajectory_msgs/MultiDOFJointTrajectory multi_dof_trajectory\n"
        "control_msgs/JointTolerance[] path_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_path_tolerance\n"
        "control_msgs/JointTolerance[] goal_tolerance\n"
        "control_msgs/JointComponentTolerance[] component_goal_tolerance\n"
        "builtin_interfaces/Duration goal_time_tolerance",
        "int32 error_code\nstring error_string",
        PROGRESS.format(index="", multi_dof_index=""),
    ),
    GRIPPER: ("control_msgs/GripperCommand command", GRIPPED, GRIPPED),
}
FEEDBACK_6 = PROGRESS.format(index="\nint32 index", multi_dof_index="\nint32 multi_dof_index")


class ControlMsgs(IntEnum):
    """The generations of control_msgs that differ, by their version."""

    JAZZY = 5
    NEWER = 6  # from 6.3 on


HASHES = {  # RIHS01, in hexadecimal; of services and of the parts of actions that of the whole service
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "trajectory_msgs/msg/JointTrajectory": "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "rcl_interfaces/msg/Log": "e28ce254ca8abc06abf92773b74602cdbf116ed34fbaf294fb9f81da9f318eac",
    "action_msgs/msg/GoalStatusArray": "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
    "visualization_msgs/msg/MarkerArray": "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
    "sensor_msgs/msg/CompressedImage": "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "control_msgs/msg/JointJog": "ba249455a20f70168a1acb7bf43b776b72ff1f7eb5fc4cfea443f749e963c6e7",
    "geometry_msgs/msg/TwistStamped": "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    f"{FOLLOW}_FeedbackMessage": "80398fcb9674a79081a9906e2ccf0c804dd7cb15e22e362e606ee87186beab71",
    f"{GRIPPER}_FeedbackMessage": "392ff03fcd872f9dc2405cbeb2897fcf011ad9998458b6aa85c603b8a49e431d",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "action_msgs/srv/CancelGoal": "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
    "rcl_interfaces/srv/ListParameters": "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
    "rcl_interfaces/srv/GetParameters": "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
    "rcl_interfaces/srv/GetParameterTypes": "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca",
    "rcl_interfaces/srv/DescribeParameters": "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff",
    "rcl_interfaces/srv/SetParameters": "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0",
    "rcl_interfaces/srv/SetParametersAtomically": "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd",
    f"{FOLLOW}_SendGoal": "b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f",
    f"{FOLLOW}_GetResult": "e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b",
    f"{GRIPPER}_SendGoal": "6bf8cc4ce80cd499e7dd3258c03c50c3fa6672b469ff8355339ef1df77fcd212",
    f"{GRIPPER}_GetResult": "7e60a7606063d4a2728d21badac099e68b734a196ac3ab42d1d4c668eb0bb3cd",
}
FEEDBACK_HASH_6 = "95618cc73912d99b9acaa17d2da5e832cb0bfdeede7534fa8ec600feca2a6c4b"


class BadRosMessage(ValueError):
    """A payload that is not what its key says."""


def ros_type(name: str, generation: ControlMsgs = ControlMsgs.JAZZY) -> RosType:
    """The type with its hash; raises `KeyError` for one that is in no table."""
    newer = generation is ControlMsgs.NEWER and name == f"{FOLLOW}_FeedbackMessage"
    return RosType(name, f"RIHS01_{FEEDBACK_HASH_6 if newer else HASHES[name]}")


@cache
def store(generation: ControlMsgs = ControlMsgs.JAZZY) -> Typestore:
    """All types of the tables, beside those of rosbags; takes some 60 ms."""
    found = get_typestore(Stores.ROS2_JAZZY)
    found.max_sequence_length = MOST_ELEMENTS
    for name in MESSAGES.keys() & found.fielddefs.keys():
        del found.fielddefs[name], found.types[name]
    parsed: dict[str, Any] = {}
    for name, text in definitions(generation):
        package, _, base = name.split("/")
        (fields,) = get_types_from_msg(text, f"{package}/action/{base}").values()  # else it renames what is no message
        parsed[name] = fields
    found.register(parsed)
    return found


def definitions(generation: ControlMsgs = ControlMsgs.JAZZY) -> Iterator[tuple[str, str]]:
    """Every type of the tables with its text, and those that rosidl makes of an action."""
    yield from MESSAGES.items()
    for name, (request, response) in SERVICES.items():
        yield f"{name}_Request", request
        yield f"{name}_Response", response
    for name, (goal, result, progress) in ACTIONS.items():
        uuid = "unique_identifier_msgs/UUID goal_id"
        yield f"{name}_Goal", goal
        yield f"{name}_Result", result
        yield f"{name}_Feedback", FEEDBACK_6 if generation is ControlMsgs.NEWER and name == FOLLOW else progress
        yield f"{name}_SendGoal_Request", f"{uuid}\n{name}_Goal goal"
        yield f"{name}_SendGoal_Response", "bool accepted\nbuiltin_interfaces/Time stamp"
        yield f"{name}_GetResult_Request", uuid
        yield f"{name}_GetResult_Response", f"int8 status\n{name}_Result result"
        yield f"{name}_FeedbackMessage", f"{uuid}\n{name}_Feedback feedback"


def make(kind: str, generation: ControlMsgs = ControlMsgs.JAZZY, /, **values: Any) -> Any:
    """A message of the type `kind` with all its fields; numbers of sequences are numpy arrays."""
    return store(generation).types[kind](**values)


def encode(message: Any, generation: ControlMsgs = ControlMsgs.JAZZY) -> bytes:
    """The message in CDR, little-endian, with its header of four bytes."""
    return bytes(store(generation).serialize_cdr(message, message.__msgtype__, little_endian=True))


def decode(name: str, payload: bytes) -> Any:
    """The message in `payload`; raises `BadRosMessage`."""
    try:
        return store().deserialize_cdr(payload, name)
    except (SerdeError, IndexError) as error:
        raise BadRosMessage(f"{name}: {error}") from error
