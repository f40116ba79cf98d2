"""The bridge as a node of ROS 2 sees it: tokens by string, topics, late joiners, services and parameters."""

from __future__ import annotations

import re
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import trimesh
from msgspec.structs import replace

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.ros2 import messages
from gemelo.libraries.ros2.images import IMAGE, INFO
from gemelo.libraries.ros2.markers import MARKERS
from gemelo.libraries.ros2.types import HASHES, ros_type
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.deployment import RosMeshes
from gemelo.schemas.device import (
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceMode,
    DeviceStatus,
    DeviceStopRequest,
    ResumeCommand,
    StopKind,
)
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import (
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    SphereShape,
)
from gemelo.schemas.topics import (
    DESCRIPTION,
    DEVICE_COMMAND,
    DEVICE_STATUS,
    DEVICE_STOP,
    FRAMES,
    JOINT_STATES,
    PLANNED_PATH,
    SCENE,
    STATIC_FRAMES,
    camera_image,
    camera_info,
)
from gemelo.services.ros_bridge.main import require_usable
from gemelo.services.state_publisher.main import describe
from tests.ros_bridge.bridges import Bridge, running
from tests.ros_bridge.ros_client import RosClient, comes
from tests.runtime.support import hear, until

MARKED = {"%gemelo%scene", "%gemelo%planned_path"}
TRIGGER = "std_srvs/srv/Trigger"
PARAMETERS = "rcl_interfaces/srv"
STATE = JointState(stamp=1_700_000_000_123_456_789, name=("a", "b"), position=(0.5, -1.0), velocity=(0.0, 0.1))


@pytest.fixture
def bridge(tmp_path: Path) -> Iterator[Bridge]:
    with running(tmp_path) as found:
        await_tokens(found)
        yield found


def await_tokens(bridge: Bridge) -> None:
    """Until the last that is declared is there, as a client of ROS waits for a server."""
    assert until(lambda: any("set_parameters_atomically" in token for token in bridge.client.tokens()))


def test_everything_that_ros_lists_is_there_by_its_token(bridge: Bridge) -> None:
    tokens = bridge.client.tokens()
    session = tokens[0].split("/")[2]
    start = f"@ros2_lv/0/{session}/0"
    assert f"{start}/0/NN/%/%/gemelo" in tokens
    hash_ = HASHES["sensor_msgs/msg/JointState"]
    joints = f"sensor_msgs::msg::dds_::JointState_/RIHS01_{hash_}/::,10:,:,:,,"
    assert f"{start}/1/MP/%/%/gemelo/%joint_states/{joints}" in tokens
    publishers = {each.split("/")[9]: each.split("/")[12] for each in tokens if "/MP/" in each}
    latched = {name for name, qos in publishers.items() if qos.startswith(":1:")}
    assert latched == {"%tf_static", "%robot_description", "%robot_description_semantic", "%rosout", *MARKED}
    assert publishers["%tf"] == "::,100:,:,:,,"
    services = {each.split("/")[9] for each in tokens if "/SS/" in each}
    assert {f"%gemelo%{name}" for name in ("stop", "hold", "resume", "reset", "list_parameters")} <= services
    assert len(services) == 10


def test_a_joint_state_arrives_with_the_stamp_of_its_measurement_and_an_attachment(bridge: Bridge) -> None:
    heard = bridge.client.subscribe("/joint_states", "sensor_msgs/msg/JointState")
    with bridge.node("stepper_gateway") as gateway:
        states = gateway.publisher(JOINT_STATES)

        def put_and_hear() -> bool:
            states.put(STATE)
            return hear(gateway, lambda: len(heard) > 1, 0.1)

        assert any(put_and_hear() for _ in range(300))
    message = heard[0].message
    assert messages.nanoseconds(message.header.stamp) == STATE.stamp
    assert (tuple(message.name), tuple(message.position)) == (STATE.name, STATE.position)
    first, second = heard[0].attachment, heard[1].attachment
    assert second.sequence == first.sequence + 1
    assert (first.stamp, len(first.gid)) == (STATE.stamp, 16)


def test_a_late_joiner_gets_description_and_static_frames_and_they_have_the_meshes(
    bridge: Bridge, rm1: ArmDescription
) -> None:
    frame = FrameTransform(stamp=7, parent="base", child="plate")
    with bridge.node("state_publisher") as publisher:
        publisher.publisher(DESCRIPTION).put(describe(rm1))
        publisher.publisher(STATIC_FRAMES).put(FrameTransforms(transforms=(frame,)))
        early = bridge.client.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        comes(early)
        with RosClient(bridge.locator) as late:
            urdf = comes(late.subscribe("/robot_description", "std_msgs/msg/String", latched=True)).data
            srdf = comes(late.subscribe("/robot_description_semantic", "std_msgs/msg/String", latched=True)).data
            static = comes(late.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", latched=True))
        for address in re.findall(r'filename="(http://127\.0\.0\.1:[^"]+)"', urdf):
            mesh = trimesh.load(BytesIO(fetched(address)), file_type="stl")
            own = trimesh.load(rm1.folder / f"meshes/{Path(address).stem}.glb", force="mesh")
            assert mesh.bounds == pytest.approx(own.bounds, abs=1e-6)
        with pytest.raises(urllib.error.HTTPError):
            fetched(f"{address.partition('/meshes')[0]}/robot.toml")
    assert urdf.count("http://127.0.0.1") == describe(rm1).urdf.count(".glb")
    assert srdf == describe(rm1).srdf
    assert [each.child_frame_id for each in static.transforms] == ["plate"]


def test_a_router_of_ros_that_starts_anew_finds_everything_again(bridge: Bridge, rm1: ArmDescription) -> None:
    with bridge.node("state_publisher") as publisher:
        publisher.publisher(DESCRIPTION).put(describe(rm1))
        comes(bridge.client.subscribe("/robot_description", "std_msgs/msg/String", latched=True))
        before = len(bridge.client.tokens())
        bridge.restart_router()
        with RosClient(bridge.locator) as late:
            assert until(lambda: len(late.tokens()) == before)
            comes(late.subscribe("/robot_description", "std_msgs/msg/String", latched=True))
            assert not late.call("/gemelo/resume", TRIGGER).success


def test_a_camera_s_images_go_out_as_they_are_with_lens_and_frame(tmp_path: Path, rm1: ArmDescription) -> None:
    stands = Transform(translation=(0.0, 0.2, 0.7))
    info = CameraInfo(
        name="overhead", width=64, height=48, intrinsics=(50.0, 0.0, 32.0, 0.0, 50.0, 24.0, 0.0, 0.0, 1.0),
        distortion=(0.1,), parent="base_link", parent_from_camera=stands, is_mounted=True,
    )  # fmt: skip
    with running(tmp_path, str(rm1.folder / "cell.toml")) as bridge, bridge.node("camera") as camera:
        heard = bridge.client.subscribe("/camera/overhead/image/compressed", IMAGE)
        lenses = bridge.client.subscribe("/camera/overhead/camera_info", INFO)
        static = bridge.client.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        camera.publisher(camera_info("overhead")).put(info)
        comes(static)
        images = camera.publisher(camera_image("overhead"))

        def put_and_hear() -> bool:
            images.put(CameraImage(stamp=7, camera="overhead", width=64, height=48, data=b"jpeg's bytes"))
            return hear(camera, lambda: heard and lenses, 0.1)

        assert any(put_and_hear() for _ in range(300))
    message, lens, frame = heard[0].message, lenses[0].message, static[-1].message.transforms[-1]
    assert (message.format, bytes(message.data)) == ("jpeg", b"jpeg's bytes")
    assert messages.nanoseconds(message.header.stamp) == messages.nanoseconds(lens.header.stamp) == 7
    assert (lens.distortion_model, list(lens.d), tuple(lens.k)) == (
        "plumb_bob",
        [0.1, 0.0, 0.0, 0.0, 0.0],
        info.intrinsics,
    )
    assert (lens.p[0], lens.p[2], lens.p[3], lens.width) == (50.0, 32.0, 0.0, 64)
    assert message.header.frame_id == frame.child_frame_id == "overhead_optical_frame"
    assert (frame.header.frame_id, frame.transform.translation.z) == ("base_link", 0.7)


def fetched(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=60.0) as answer:
        return bytes(answer.read())


@pytest.mark.parametrize(("meshes", "begin"), [(RosMeshes.FILE, "file:///"), (RosMeshes.NONE, "meshes/")])
def test_meshes_are_files_of_this_host_or_as_the_arm_has_them(
    tmp_path: Path, rm1: ArmDescription, meshes: RosMeshes, begin: str
) -> None:
    with running(tmp_path, meshes=meshes) as bridge, bridge.node("state_publisher") as publisher:
        publisher.publisher(DESCRIPTION).put(describe(rm1))
        urdf = comes(bridge.client.subscribe("/robot_description", "std_msgs/msg/String", latched=True)).data
    assert f'filename="{begin}' in urdf


def test_the_scene_and_the_planned_path_are_markers_for_late_joiners(bridge: Bridge) -> None:
    pose = Transform(translation=(0.1, 0.2, 0.3))
    scene = PlanningScene(objects=(
        SceneObject(name="wall", shape=BoxShape(size=(0.1, 0.2, 0.3)), pose=pose),
        SceneObject(name="ball", shape=SphereShape(radius=0.05), frame="tool_link", attached=True),
        SceneObject(name="mesh", shape=MeshShape(path="a.stl")),
        SceneObject(name="floor", shape=PlaneShape()),
        SceneObject(name="pole", shape=CylinderShape(radius=0.02, length=0.5)),
    ))  # fmt: skip
    points = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.2))
    with bridge.node("planner") as planner:
        planner.publisher(SCENE).put(scene)
        planner.publisher(PLANNED_PATH).put(PlannedPath(points=points))
        drawn = comes(bridge.client.subscribe("/gemelo/scene", MARKERS, latched=True)).markers
        line = comes(bridge.client.subscribe("/gemelo/planned_path", MARKERS, latched=True)).markers
    assert [(each.action, each.type, each.text) for each in drawn] == [
        (3, 1, ""), (0, 1, "wall"), (0, 2, "ball"), (0, 1, "floor"), (0, 3, "pole"),
    ]  # fmt: skip
    wall, ball, pole = drawn[1], drawn[2], drawn[4]
    assert (wall.header.frame_id, wall.scale.y, wall.pose.position.z) == ("base_link", 0.2, 0.3)
    assert (ball.header.frame_id, ball.scale.x, pole.scale.z) == ("tool_link", 0.1, 0.5)
    assert [(each.x, each.y, each.z) for each in line[1].points] == list(points)


def test_moving_frames_go_out_on_tf(bridge: Bridge) -> None:
    heard = bridge.client.subscribe("/tf", "tf2_msgs/msg/TFMessage")
    frame = FrameTransform(stamp=7, parent="base", child="tool")
    with bridge.node("state_publisher") as publisher:
        frames = publisher.publisher(FRAMES)

        def put_and_hear() -> bool:
            frames.put(FrameTransforms(transforms=(frame,)))
            return hear(publisher, lambda: heard, 0.1)

        assert any(put_and_hear() for _ in range(300))
    assert heard[0].message.transforms[0].header.frame_id == "base"


def test_diagnostics_say_how_the_device_is(bridge: Bridge) -> None:
    heard = bridge.client.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    first = comes(heard)
    assert first.status[0].level == messages.STALE
    with bridge.node("stepper_gateway") as gateway:
        gateway.publisher(DEVICE_STATUS).put(DeviceStatus(online=False, reason="no cable", device="esp"))
        assert hear(gateway, lambda: heard[-1].message.status[0].level == messages.ERROR)
    assert (heard[-1].message.status[0].message, heard[-1].message.status[0].hardware_id) == ("no cable", "esp")


def test_a_stop_and_a_hold_reach_the_gateway_and_its_answer_comes_back(bridge: Bridge) -> None:
    asked: list[StopKind] = []

    def stop(question: DeviceStopRequest) -> DeviceCommandResponse:
        asked.append(question.kind)
        accepted = question.kind is StopKind.STOP
        return DeviceCommandResponse(accepted=accepted, mode=DeviceMode.IDLE, reason="" if accepted else "not now")

    with bridge.node("stepper_gateway") as gateway:
        gateway.serve(DEVICE_STOP, stop)
        answers = [concurrently(gateway, bridge, name) for name in ("stop", "hold")]
    assert asked == [StopKind.STOP, StopKind.HOLD]
    assert [(each.success, each.message) for each in answers] == [(True, ""), (False, "not now")]


def concurrently(gateway: Node, bridge: Bridge, name: str) -> Any:
    """The response of a trigger, while the gateway handles what it is asked."""
    found: list[Any] = []
    asking = threading.Thread(target=lambda: found.append(bridge.client.call(f"/gemelo/{name}", TRIGGER)))
    asking.start()
    assert hear(gateway, lambda: found)
    asking.join()
    return found[0]


def test_without_motion_nothing_lets_the_arm_move_and_the_answer_says_so(bridge: Bridge) -> None:
    for name in ("resume", "reset"):
        answer = bridge.client.call(f"/gemelo/{name}", TRIGGER)
        assert not answer.success
        assert "motion = true" in answer.message


def test_with_motion_a_resume_reaches_the_device(tmp_path: Path) -> None:
    asked: list[DeviceCommandRequest] = []

    def command(question: DeviceCommandRequest) -> DeviceCommandResponse:
        asked.append(question)
        return DeviceCommandResponse(accepted=True)

    with running(tmp_path, motion=True) as bridge, bridge.node("stepper_gateway") as gateway:
        gateway.serve(DEVICE_COMMAND, command)
        await_tokens(bridge)
        assert concurrently(gateway, bridge, "resume").success
    assert asked == [DeviceCommandRequest(command=ResumeCommand())]


def test_an_empty_request_without_its_one_byte_is_answered_too(bridge: Bridge) -> None:
    answer = bridge.client.ask("/gemelo/resume", TRIGGER, bytes.fromhex("00010000"))
    assert not answer.success


def test_parameters_are_listed_got_and_described_and_none_is_set(bridge: Bridge) -> None:
    client = bridge.client
    assert until(lambda: any("set_parameters_atomically" in token for token in client.tokens()))
    names = list(
        client.call("/gemelo/list_parameters", f"{PARAMETERS}/ListParameters", prefixes=[], depth=0).result.names
    )
    assert {"robot", "joints", "motion", "use_sim_time"} <= set(names)
    asked = ["robot", "motion", "rate", "joints", "no such"]
    values = client.call("/gemelo/get_parameters", f"{PARAMETERS}/GetParameters", names=asked).values
    assert [each.type for each in values] == [4, 1, 3, 9, 0]
    assert (values[0].string_value, values[1].bool_value) == ("rm1", False)
    described = client.call("/gemelo/describe_parameters", f"{PARAMETERS}/DescribeParameters", names=["robot"])
    assert [(each.name, each.read_only) for each in described.descriptors] == [("robot", True)]
    types = client.call("/gemelo/get_parameter_types", f"{PARAMETERS}/GetParameterTypes", names=asked).types
    assert list(types) == [4, 1, 3, 9, 0]
    wanted = messages.make("rcl_interfaces/msg/Parameter", name="motion", value=values[1])
    result = client.call("/gemelo/set_parameters", f"{PARAMETERS}/SetParameters", parameters=[wanted]).results[0]
    assert not result.successful
    assert result.reason == str(because("ros.parameter.read_only", remedy("ros_set_parameter"), name="motion"))


def test_a_namespace_and_a_domain_stand_before_everything_but_tf(tmp_path: Path) -> None:
    with running(tmp_path, namespace="rm1", domain=5) as bridge:
        await_tokens(bridge)
        names = {each.split("/")[9] for each in bridge.client.tokens() if "/MP/" in each}
        assert {"%rm1%joint_states", "%tf", "%rm1%robot_description"} <= names
        heard = bridge.client.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
        with bridge.node("state_publisher") as publisher:
            frame = FrameTransform(parent="base", child="tool")
            publisher.publisher(STATIC_FRAMES).put(FrameTransforms(transforms=(frame,)))
            static = comes(heard)
    assert (static.transforms[0].header.frame_id, static.transforms[0].child_frame_id) == ("rm1/base", "rm1/tool")


@pytest.mark.parametrize(("router", "code"), [("", "ros.router.none"), ("tcp/127.0.0.1:7447", "ros.router.own")])
def test_without_a_router_of_ros_or_with_our_own_it_does_not_start(bridge: Bridge, router: str, code: str) -> None:
    section = replace(bridge.deployment.ros, router=router)
    with pytest.raises(ConfigurationError) as refused:
        require_usable(section, bridge.deployment)
    assert refused.value.reason.code == code


def test_nobody_hears_a_key_of_another_hash(bridge: Bridge) -> None:
    patched = ros_type("sensor_msgs/msg/JointState")._replace(hash="RIHS01_0")
    heard = bridge.client.subscribe("/joint_states", "sensor_msgs/msg/JointState", type_=patched)
    right = bridge.client.subscribe("/joint_states", "sensor_msgs/msg/JointState")
    with bridge.node("stepper_gateway") as gateway:
        states = gateway.publisher(JOINT_STATES)

        def put_and_hear() -> bool:
            states.put(STATE)
            return hear(gateway, lambda: right, 0.1)

        assert any(put_and_hear() for _ in range(300))
    assert heard == []
