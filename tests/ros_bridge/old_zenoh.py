"""The bridge with routers and clients of an older Zenoh: `python -m tests.ros_bridge.old_zenoh PYTHON`.

deploy/try_ros makes `PYTHON`, of an environment that has that Zenoh; routers of ROS distributions have 1.6.2 and 1.8.0.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.ros2.types import ros_type
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.ros_wire.graph import entities
from gemelo.libraries.runtime.ros_wire.names import data_key
from gemelo.schemas.topics import DESCRIPTION
from gemelo.services.state_publisher.main import describe
from tests.ros_bridge.ros_client import ros_router
from tests.ros_bridge.test_ros_process import end, speaking
from tests.runtime.support import ROOT, RouterProcess, free_port, until

PEER = Path(__file__).with_name("zenoh_peer.py")
KEYS = {
    "latched": data_key(0, "/robot_description", ros_type("std_msgs/msg/String")),
    "rate": data_key(0, "/joint_states", ros_type("sensor_msgs/msg/JointState")),
    "service": data_key(0, "/gemelo/resume", ros_type("std_srvs/srv/Trigger")),
}
TOKENS = 20  # of the bridge at least
LEAST, MOST = 45.0, 55.0  # [Hz] of joint states


def judge(own: RouterProcess, locator: str, python: str) -> dict[str, object]:
    """What the old client has received of a bridge on that router; raises AssertionError where something is missing."""
    environ = own.environ | {"GEMELO_ROS_ROUTER": locator, "GEMELO_ROBOT": "urdf/rm1"}
    bridge = subprocess.Popen(
        [sys.executable, "-m", "gemelo.services.ros_bridge.main"], cwd=ROOT, env=environ, stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    try:
        assert until(lambda: any("set_parameters_atomically" in each.name for each in entities(locator)))
        asked = [python, str(PEER), "client", locator, json.dumps(KEYS)]
        found = json.loads(subprocess.run(asked, capture_output=True, text=True, check=True, timeout=120.0).stdout)
    finally:
        code, said = end(bridge)
    assert code == 0, said
    assert found["tokens"] >= TOKENS, found
    assert found["latched"], found
    assert LEAST < found["rate"] < MOST, found
    assert found["attachments"] == [33], found
    assert len(found["answers"]) == 1, found
    return found


def main(python: str) -> None:
    """Once with an old router and an old client, once with a new router."""
    with tempfile.TemporaryDirectory() as folder:
        own = RouterProcess(Path(folder))
        try:
            with (
                Node("state_publisher", own.deployment, robot="rm1", stop=ShutdownRequest()) as publisher,
                speaking(own),
            ):
                publisher.publisher(DESCRIPTION).put(describe(load_arm(ROOT / "urdf/rm1")))
                locator = f"tcp/127.0.0.1:{free_port()}"
                command = [python, str(PEER), "router", locator]
                with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as router:
                    assert router.stdout is not None
                    assert router.stdout.readline() == "listening\n"
                    print("old router and old client:", judge(own, locator, python))
                    router.communicate()
                with ros_router() as locator:
                    print("new router and old client:", judge(own, locator, python))
        finally:
            own.kill()


if __name__ == "__main__":
    main(sys.argv[1])
