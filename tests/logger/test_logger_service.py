"""The logger as a node, and as a process that is killed."""

import csv
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path

import msgspec
import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Channel
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.endpoints import parameter_request
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import (
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceEvent,
    DeviceStopRequest,
    ReferenceCommand,
    ResetCommand,
    SpeedCommand,
)
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message
from gemelo.schemas.planning import PlanCode, PlanRequest, PlanResponse
from gemelo.schemas.scene import CylinderShape, SceneAdd, SceneObject, SceneRemove, SceneRequest
from gemelo.schemas.system import LogRecord, SetParameter
from gemelo.schemas.topics import (
    COMMAND_ACKS,
    COMMANDS,
    DESCRIPTION,
    DEVICE_COMMAND,
    DEVICE_EVENTS,
    DEVICE_STOP,
    GRIPPER_COMMAND,
    JOINT_STATES,
    LOG,
    PLAN,
    SCENE_EDIT,
    Delivery,
    Request,
    Topic,
)
from gemelo.services.logger.main import run
from gemelo.services.planner.scene.scene_store import SceneStore
from gemelo.services.visualizer.render.outputs import VisualizerParameters

ROOT = Path(__file__).parents[2]


@pytest.fixture
def environment(tmp_path):
    return {
        "GEMELO_PATHS_RUN": str(tmp_path / "run"), "GEMELO_PATHS_OUT": str(tmp_path / "out"),
        "GEMELO_ROUTER_PORT": str(free_port()),
    }  # fmt: skip


@pytest.fixture
def deployment(environment):
    return load_deployment(environ=environment)


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def running(deployment, network, **parameters):
    """The logger in a thread of its own."""
    with Node("logger", deployment, bus=MemoryBus(network), overrides=parameters) as node:
        thread = threading.Thread(target=run, args=(node, deployment))
        thread.start()
        try:
            wait_for(lambda: node.is_ready)
            yield node
        finally:
            node.stop()
            thread.join(60.0)
            assert not thread.is_alive()


HANGS = 60.0  # [s] in which processes start, write and end, unless they hang


def wait_for(is_done, timeout=60.0):
    deadline = time.monotonic() + timeout
    while not is_done():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def messages(path):
    with path.open("rb") as file:
        return [(channel.topic, json.loads(message.data)) for _, channel, message in make_reader(file).iter_messages()]


def recordings(tmp_path, kind):
    return sorted((tmp_path / "out" / "recordings").glob(f"*{kind}"))


def test_what_is_said_on_the_bus_is_in_the_files(deployment, tmp_path, chunk, ack):
    network = MemoryNetwork()
    with (
        Node("state_publisher", deployment, bus=MemoryBus(network)) as state_publisher,
        Node("gateway", deployment, bus=MemoryBus(network)) as gateway,
    ):
        state_publisher.publisher(DESCRIPTION).put(RobotDescription(robot="rm1", urdf="<robot/>"))
        with running(deployment, network):
            for seq in range(40):
                gateway.publisher(COMMANDS).put(chunk(seq))
                gateway.publisher(COMMAND_ACKS).put(ack(seq))
                gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(device="rm1", event="started", detail=str(seq)))
            gateway.publisher(JOINT_STATES).put(JointState(stamp=5, name=("a",), position=(0.5,)))
            time.sleep(0.1)
    (mcap,) = recordings(tmp_path, ".mcap")
    found = messages(mcap)
    assert [m["seq"] for topic, m in found if topic == "commands"] == list(range(40))
    assert [m["detail"] for topic, m in found if topic == "device/events"] == [str(seq) for seq in range(40)]
    assert ("description", "rm1") in [(topic, m.get("robot")) for topic, m in found]
    assert [m["position"] for topic, m in found if topic == "joint_states"] == [[0.5]]
    (table,) = recordings(tmp_path, ".csv")
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len(rows) == 200
    assert {row["ack_code"] for row in rows} == {"0"}
    assert table.stem == mcap.stem


class Torque(Message, frozen=True, kw_only=True):
    """A message of a user's own."""

    stamp: int = 0
    value: float = 0.0  # [N m]
    history: tuple[float, ...] = ()


TORQUE = Topic("gripper/torque", Torque, Delivery.EVERY, None, True, "torque_sensor", "a user's own topic")
WEIGH = Request("gripper/weigh", Torque, Torque, "torque_sensor", "a user's own request")


class SensorParameters(msgspec.Struct, frozen=True, kw_only=True):
    gain: float = 1.0


@contextmanager
def spinning(node):
    thread = threading.Thread(target=node.spin)
    thread.start()
    try:
        yield node
    finally:
        node.stop()
        thread.join(60.0)


def heard(node, key):
    return sum(each.received for each in node.statistics() if each.key == key)


def test_goals_requests_parameters_and_a_users_topic_are_recorded_as_what_they_are(deployment, tmp_path):
    """Read with the MCAP library alone: every message by its fields, none as bytes inside of another."""
    network = MemoryNetwork()
    with (
        running(deployment, network) as logger,
        Node("planner", deployment, bus=MemoryBus(network)) as planner,
        Node("stepper_gateway", deployment, bus=MemoryBus(network)) as gateway,
        Node("torque_sensor", deployment, bus=MemoryBus(network)) as sensor,
        Node("client", deployment, bus=MemoryBus(network)) as client,
    ):
        planner.serve(PLAN, lambda question: PlanResponse(code=PlanCode.SUCCESS))
        gateway.serve(DEVICE_STOP, lambda question: DeviceCommandResponse(accepted=True))
        action = gateway.serve_action(GRIPPER_COMMAND, lambda goal_id, goal: accept(), lambda goal_id: None)
        sensor.serve(WEIGH, lambda question: Torque(value=question.value + 1.0))
        sensor.parameters(SensorParameters)
        torque = sensor.publisher(TORQUE)
        with spinning(planner), spinning(gateway), spinning(sensor):
            client.call(PLAN, PlanRequest(velocity_scaling=0.25))
            client.call(DEVICE_STOP, DeviceStopRequest())
            handle = client.action(GRIPPER_COMMAND).send(GripperCommandGoal(position=0.02))
            gateway.post(lambda: action.feedback(handle.goal_id, GripperCommandFeedback(position=0.03)))
            gateway.post(lambda: action.finish(handle.goal_id, GoalStatusCode.SUCCEEDED, GripperCommandResult()))
            sensor.set_parameter("gain", 2.5)
            wait_for(lambda: {"gripper/torque", "@request/gripper/weigh"} <= set(logger.info().subscribes))
            torque.put(Torque(stamp=7, value=0.5, history=(0.25, 0.5)))
            client.call(WEIGH, Torque(value=3.0))
            wait_for(lambda: heard(logger, "gripper/torque") and heard(logger, "@request/gripper/weigh"))
    (mcap,) = recordings(tmp_path, ".mcap")
    said = {}
    for topic, message in messages(mcap):
        said.setdefault(topic, []).append(message)
    assert said["@request/plan"][0]["question"]["velocity_scaling"] == 0.25
    assert said["@request/plan"][0]["answer"]["code"] == PlanCode.SUCCESS
    assert said["@request/device/stop"][0]["answer"]["accepted"] is True
    assert said["@request/gripper_command/goal"][0]["question"]["goal"]["position"] == 0.02
    assert said["gripper_command/feedback"][0]["feedback"]["position"] == 0.03
    assert said["gripper_command/ended"][0]["status"] == GoalStatusCode.SUCCEEDED
    assert said["parameters"][0]["parameter"]["value"] == 2.5
    assert said["gripper/torque"] == [{"stamp": 7, "value": 0.5, "history": [0.25, 0.5]}]
    assert said["@request/gripper/weigh"][0]["question"]["value"] == 3.0
    assert said["@request/gripper/weigh"][0]["answer"]["value"] == 4.0
    nodes = {record["node"]: record for record in said["nodes"]}
    assert nodes["torque_sensor"]["parameters"][0]["name"] == "gain"
    assert nodes["torque_sensor"]["info"]["version"]
    with mcap.open("rb") as file:
        summary = make_reader(file).get_summary()
        kept = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    schemas = {each.topic: json.loads(summary.schemas[each.schema_id].data) for each in summary.channels.values()}
    assert schemas["gripper/torque"]["properties"]["value"]["type"] == "number"
    assert json.loads(kept["deployment"]["json"])["router"]["port"] == deployment.router.port
    assert kept["gemelo"]["ruckig"]


def answer_to(question):
    """As a gateway in Idle says it."""
    if question.command == ResetCommand():
        return DeviceCommandResponse(reason="no fault")
    return DeviceCommandResponse(accepted=True)


def test_what_persons_command_and_change_in_the_scene_is_recorded_with_its_answer(deployment, tmp_path):
    """By the same calls that the command line, the page and scripts make."""
    network = MemoryNetwork()
    cup = SceneObject(name="cup", shape=CylinderShape(radius=0.04, length=0.1))
    edits = (SceneAdd(object=cup), SceneRemove(name="no_cup"))
    commands = (ReferenceCommand(name=("brazo_joint",), position=(0.25,)), SpeedCommand(scale=0.5), ResetCommand())
    store = SceneStore(load_arm(ROOT / "urdf/rm1"))
    with (
        running(deployment, network) as logger,
        Node("planner", deployment, bus=MemoryBus(network)) as planner,
        Node("stepper_gateway", deployment, bus=MemoryBus(network)) as gateway,
        Node("client", deployment, bus=MemoryBus(network)) as client,
    ):
        planner.serve(SCENE_EDIT, lambda question: store.edit(question, lambda: None, 0))
        gateway.serve(DEVICE_COMMAND, answer_to)
        with spinning(planner), spinning(gateway):
            for edit in edits:
                client.call(SCENE_EDIT, SceneRequest(edit=edit))
            for command in commands:
                client.call(DEVICE_COMMAND, DeviceCommandRequest(command=command))
        wait_for(lambda: heard(logger, "@request/scene/edit") == len(edits))
        wait_for(lambda: heard(logger, "@request/device/command") == len(commands))
    (mcap,) = recordings(tmp_path, ".mcap")
    said = {}
    for topic, message in messages(mcap):
        said.setdefault(topic, []).append(message)
    asked = said["@request/scene/edit"]
    assert [msgspec.convert(each["question"], SceneRequest).edit for each in asked] == list(edits)
    assert [each["answer"]["accepted"] for each in asked] == [True, False]
    told = said["@request/device/command"]
    assert [msgspec.convert(each["question"], DeviceCommandRequest).command for each in told] == list(commands)
    assert [each["answer"]["accepted"] for each in told] == [True, True, False]
    assert told[2]["answer"]["reason"] == "no fault"
    assert all(each["clients"] for each in (*asked, *told))  # who has asked


def test_a_black_box_holds_configuration_versions_parameters_logs_and_the_layout_of_the_view(deployment, tmp_path):
    network = MemoryNetwork()
    with (
        running(deployment, network) as logger,
        Node("visualizer", deployment, bus=MemoryBus(network), overrides={"window": "7.5"}) as visualizer,
        Node("stepper_gateway", deployment, bus=MemoryBus(network)) as gateway,
    ):
        visualizer.parameters(VisualizerParameters)
        visualizer.publisher(TORQUE)  # which the logger subscribes to when it has asked this node about itself
        with spinning(visualizer), spinning(gateway):
            wait_for(lambda: TORQUE.key in logger.info().subscribes)
            gateway.log.warning("the belt is slack")
            wait_for(lambda: heard(logger, "log"))
            gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(device="rm1", event="rebooted", detail="watchdog"))
            wait_for(lambda: list((tmp_path / "out" / "blackbox").glob("*.mcap")))
    (box,) = (tmp_path / "out" / "blackbox").glob("*.mcap")
    with box.open("rb") as file:
        kept = {record.name: record.metadata for record in make_reader(file).iter_metadata()}
    assert kept["gemelo"]["gemelo"] == version("gemelo")
    assert json.loads(kept["deployment"]["json"])["router"]["port"] == deployment.router.port
    assert json.loads(kept["layout"]["json"]) == {"window": 7.5, "trail": 20.0, "cameras": []}
    said = messages(box)
    assert "the belt is slack" in [message["text"] for topic, message in said if topic == "log"]
    parameters = {message["node"]: message["parameters"] for topic, message in said if topic == "nodes"}
    assert {each["name"] for each in parameters["visualizer"]} >= {"window", "trail"}


def test_logging_is_switched_off_and_on_while_it_runs(deployment, tmp_path):
    network = MemoryNetwork()
    with Node("gateway", deployment, bus=MemoryBus(network)) as gateway, running(deployment, network) as logger:
        set_parameter(logger, "enable_logging", False)
        time.sleep(0.7)
        gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(event="unheard"))
        time.sleep(0.7)
        set_parameter(logger, "enable_logging", True)
        gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(event="heard"))
        time.sleep(0.1)
    events = [m["event"] for path in recordings(tmp_path, ".mcap") for topic, m in messages(path)
              if topic == "device/events"]  # fmt: skip
    assert events == ["heard"]


def set_parameter(node, name, value):
    node.set_parameter(name, value)


def test_a_disk_that_refuses_is_not_ready_until_it_is_mended(deployment, tmp_path):
    (tmp_path / "out").write_text("in the way")
    with Node("logger", deployment, bus=MemoryBus(MemoryNetwork())) as node:
        thread = threading.Thread(target=run, args=(node, deployment))
        thread.start()
        time.sleep(1.0)
        assert thread.is_alive()
        assert not node.is_ready
        (tmp_path / "out").unlink()
        wait_for(lambda: node.is_ready)
        node.stop()
        thread.join(60.0)


@contextmanager
def process(module, environment, *arguments):
    with subprocess.Popen(
        [sys.executable, "-m", module, *arguments], env={**os.environ, **environment}, stderr=subprocess.PIPE
    ) as started:
        try:
            yield started
        finally:
            started.kill()


def test_kill_9_of_the_service_leaves_a_file_that_can_be_read(environment, deployment, tmp_path):
    run_folder = tmp_path / "run"
    with (
        process("gemelo.services.router.main", environment),
        process("gemelo.services.logger.main", environment) as logger,
    ):
        wait_for(lambda: (run_folder / "logger.ready").exists())
        with Node("gateway", deployment) as gateway:
            for index in range(300):
                gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(event=str(index)))
            wait_for(lambda: sum(path.stat().st_size for path in recordings(tmp_path, ".mcap")) > 3000)
            time.sleep(0.6)
        os.kill(logger.pid, signal.SIGKILL)
        logger.wait()
    (path,) = recordings(tmp_path, ".mcap")
    assert events_before_the_end(path) == [str(index) for index in range(300)]


def events_before_the_end(path):
    events = []
    with path.open("rb") as file, pytest.raises(EndOfFile):
        events.extend(recorded_events(StreamReader(file).records))
    return events


def recorded_events(records):
    topics = {}
    for record in records:
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, McapMessage) and topics[record.channel_id] == "device/events":
            yield msgspec.json.decode(record.data)["event"]


def test_sigterm_ends_it_with_a_finished_file(environment, deployment, tmp_path):
    with (
        process("gemelo.services.router.main", environment),
        process("gemelo.services.logger.main", environment) as logger,
    ):
        wait_for(lambda: (tmp_path / "run" / "logger.ready").exists(), HANGS)
        with Node("gateway", deployment) as gateway:
            for index in range(300):
                gateway.publisher(DEVICE_EVENTS).put(DeviceEvent(event=str(index)))
            wait_for(lambda: sum(path.stat().st_size for path in recordings(tmp_path, ".mcap")) > 3000, HANGS)
        logger.terminate()
        assert logger.wait(HANGS) == 0
    (path,) = recordings(tmp_path, ".mcap")
    with path.open("rb") as file:
        assert make_reader(file).get_summary().statistics.message_count >= 300
    assert not (tmp_path / "run" / "logger.ready").exists()


def test_a_folder_that_no_disk_can_have_is_refused_and_the_logger_goes_on(deployment, tmp_path):
    network = MemoryNetwork()
    with Node("client", deployment, bus=MemoryBus(network)) as client, running(deployment, network) as logger:
        with pytest.raises(RequestRefused, match="NUL"):
            client.call(
                parameter_request("logger"),
                SetParameter(name="log_dir", value="a\0b"),
            )
        client.publisher(LOG).put(LogRecord(text="after"))
        assert logger.is_ready
    (mcap,) = recordings(tmp_path, ".mcap")
    assert "after" in [m.get("text") for topic, m in messages(mcap) if topic == "log"]
