"""The table of types: its hashes are those of its definitions, and its bytes are those of another library."""

from __future__ import annotations

from io import BytesIO

import pytest
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
from rosbags.interfaces import Nodetype

from gemelo.libraries.ros2 import messages
from gemelo.libraries.ros2.markers import path_markers
from gemelo.libraries.ros2.types import (
    ACTIONS,
    FOLLOW,
    GRIPPER,
    HASHES,
    SERVICES,
    BadRosMessage,
    ControlMsgs,
    decode,
    encode,
    make,
    ros_type,
    store,
)
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.system import LogLevel
from gemelo.services.ros_bridge import core
from gemelo.services.ros_bridge.parameters import value_of
from tests.ros_bridge.ros_goals import ros_goal

# From rmw_zenoh_cpp's own documents, and as hiroz and zenoh-ros2-sdk compute them.
KNOWN = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "trajectory_msgs/msg/JointTrajectory": "179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "action_msgs/msg/GoalStatusArray": "6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e",
    "action_msgs/srv/CancelGoal": "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
    f"{FOLLOW}_SendGoal": "b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f",
    f"{FOLLOW}_GetResult": "e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b",
    f"{FOLLOW}_FeedbackMessage": "80398fcb9674a79081a9906e2ccf0c804dd7cb15e22e362e606ee87186beab71",
    "std_srvs/srv/Trigger": "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f",
    "rcl_interfaces/srv/ListParameters": "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d",
    "rcl_interfaces/srv/GetParameters": "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc",
}
KNOWN_NEWER = "95618cc73912d99b9acaa17d2da5e832cb0bfdeede7534fa8ec600feca2a6c4b"
OF_SERVICES = [*SERVICES, *(f"{action}_{part}" for action in ACTIONS for part in ("SendGoal", "GetResult"))]


def hash_of_service(name: str) -> str:
    """Of the structure that rosidl hashes for a service: request, response, and an event with at most one of each."""
    types = store()
    of = lambda part: (Nodetype.NAME, part)  # noqa: E731
    one = lambda part: (Nodetype.SEQUENCE, (of(part), 1))  # noqa: E731
    request, response, event = f"{name}_Request", f"{name}_Response", f"{name}_Event"
    info = of("service_msgs/msg/ServiceEventInfo")
    types.fielddefs[event] = ([], [("info", info), ("request", one(request)), ("response", one(response))])
    types.fielddefs[name] = (
        [], [("request_message", of(request)), ("response_message", of(response)), ("event_message", of(event))]
    )  # fmt: skip
    return types.hash_rihs01(name)


def test_the_hashes_of_the_table_are_those_that_others_have():
    assert {name: HASHES[name] for name in KNOWN} == KNOWN
    assert ros_type(f"{FOLLOW}_FeedbackMessage", ControlMsgs.NEWER).hash == f"RIHS01_{KNOWN_NEWER}"


@pytest.mark.parametrize("name", HASHES)
def test_a_hash_of_the_table_is_that_of_its_definition(name):
    found = hash_of_service(name) if name in OF_SERVICES else store().hash_rihs01(name)
    assert found == ros_type(name).hash


def test_the_feedback_of_newer_control_msgs_has_a_hash_of_its_own():
    found = store(ControlMsgs.NEWER).hash_rihs01(f"{FOLLOW}_FeedbackMessage")
    assert found == ros_type(f"{FOLLOW}_FeedbackMessage", ControlMsgs.NEWER).hash


def test_every_service_of_the_table_and_every_part_of_an_action_has_a_hash():
    parts = ("SendGoal", "GetResult", "FeedbackMessage")
    assert {*SERVICES, *(f"{action}_{part}" for action in (FOLLOW, GRIPPER) for part in parts)} <= set(HASHES)


def test_an_empty_message_is_one_byte_behind_its_header():
    empty = make("std_srvs/srv/Trigger_Request", structure_needs_at_least_one_member=0)
    assert encode(empty) == bytes.fromhex("0001000000")


def test_a_joint_state_in_bytes():
    state = messages.joint_state(JointState(stamp=2_000_000_001, name=("a",), position=(1.0,)))
    assert encode(state).hex() == (
        "00010000" "02000000" "01000000" "01000000" "00" "000000" "01000000" "02000000" "6100" "0000" "01000000"
        "000000000000f03f" "00000000" "00000000"
    )  # fmt: skip


FRAME = FrameTransform(stamp=5, parent="base", child="tool", transform=Transform(translation=(1.0, 2.0, 3.0)))
POINT = TrajectoryPoint(positions=(0.1, 0.2), velocities=(0.0, 1.0), time_from_start=1.5)
PROGRESS = FollowJointTrajectoryFeedback(stamp=7, joint_names=("a", "b"), desired=POINT, actual=POINT, index=1)
GOAL = FollowJointTrajectoryGoal(
    trajectory=JointTrajectory(stamp=11, joint_names=("a", "b"), points=(POINT, POINT)),
    goal_tolerance=(JointTolerance(name="b", position=0.1),),
    goal_time_tolerance=2.5,
)
SAMPLES = {
    "joint state": messages.joint_state(
        JointState(stamp=3, name=("a", "bcd"), position=(1.0, -2.0), velocity=(0.0, 0.5))
    ),
    "frames": messages.frames(FrameTransforms(transforms=(FRAME, FRAME)), "rm1/"),
    "string": messages.string("<robot/>"),
    "log": messages.log(9, LogLevel.WARNING, "planner", "late"),
    "diagnostics": messages.diagnostics(1, "rm1", DeviceStatus(online=True), DeviceState(), None, None),
    "feedback": core.follow_feedback(bytes(range(16)), PROGRESS, ControlMsgs.JAZZY).feedback,
    "goal": ros_goal(GOAL),
    "markers": path_markers(PlannedPath(points=((0.0, 1.0, 2.0),)), "base"),
    "result": core.lost_result("gone"),
    "parameters": make(
        "rcl_interfaces/srv/GetParameters_Response", values=[value_of(each) for each in (True, 1, 2.5, "x", ("y", "z"))]
    ),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_another_library_reads_our_bytes_and_writes_the_same(name):
    message = SAMPLES[name]
    kind = message.__msgtype__
    text, _ = store().generate_msgdef(kind, ros_version=2)
    schema_name = "/".join(part for part in kind.split("/") if part not in ("msg", "srv", "action"))
    schema = Schema(id=1, data=text.encode(), encoding="ros2msg", name=schema_name)
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    read = decoder(encode(message))
    file = BytesIO()
    writer = Writer(file)
    writer.write_message("topic", writer.register_msgdef(schema_name, text), read)
    writer.finish()
    (_, _, written), *_ = make_reader(BytesIO(file.getvalue())).iter_messages()
    assert written.data == encode(message)


@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 64, b"\0\3\0\0" + bytes(64)])
def test_what_is_no_message_is_refused(payload):
    with pytest.raises(BadRosMessage):
        decode("sensor_msgs/msg/JointState", payload)
