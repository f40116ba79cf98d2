"""The visualizer as a node: not ready before it knows the arm, and its recording is whole when it stops."""

import subprocess
import threading
import time

import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, JOINT_STATES
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.main import run
from gemelo.services.visualizer.program.rerun_program import rerun_binary

NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")


@pytest.fixture
def deployment(tmp_path):
    return load_deployment(environ={"GEMELO_PATHS_RUN": str(tmp_path / "run"), "GEMELO_VIEWER_MODE": "none"})


def wait_for(is_done, timeout=60.0):
    deadline = time.monotonic() + timeout
    while not is_done():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_it_is_ready_when_it_knows_the_arm_and_records_what_the_arm_does(deployment, urdf_text, tmp_path):
    network = MemoryNetwork()
    recording = tmp_path / "view.rrd"
    overrides = {"recording_path": str(recording)}
    with (
        Node("state_publisher", deployment, bus=MemoryBus(network)) as state_publisher,
        Node("visualizer", deployment, bus=MemoryBus(network), overrides=overrides) as node,
    ):
        thread = threading.Thread(target=run, args=(node, deployment))
        thread.start()
        time.sleep(0.4)
        assert not node.is_ready
        descriptions = state_publisher.publisher(DESCRIPTION)
        descriptions.put(RobotDescription(robot="rm1", urdf="<nonsense"))
        descriptions.put(RobotDescription(robot="rm1", urdf=urdf_text, robot_toml="= no toml"))
        time.sleep(0.2)
        assert not node.is_ready
        description = RobotDescription(robot="rm1", urdf=urdf_text, robot_toml='tool_frame = "efector_link"')
        descriptions.put(description)
        wait_for(lambda: node.is_ready)
        for index in range(20):
            state = JointState(stamp=time.time_ns(), name=NAMES, position=(0.01 * index, 0.0, 0.0))
            state_publisher.publisher(JOINT_STATES).put(state)
            time.sleep(0.01)
        time.sleep(0.2)
        node.stop()
        thread.join(60.0)
        assert not thread.is_alive()
    printed = subprocess.run([rerun_binary(), "rrd", "print", recording], capture_output=True, text=True, check=True)
    assert f"/{entities.executed('brazo_joint')}" in printed.stdout
    assert f"/{entities.MEASURED}/base_link/brazo_link/visual_0" in printed.stdout
