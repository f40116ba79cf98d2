"""Figures across hosts with TLS, against one machine's loopback without.

`sudo .venv/bin/python -m tests.stack.far_figures` prints them as a table. Device, gateway, router and client each have
a namespace of their own, on a bridge of the kernel. A state's way is from the device's measurement to the frames at
the client, so over both wires; all clocks are one machine's.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import DeviceEvent
from gemelo.schemas.frames import FrameTransforms
from gemelo.schemas.topics import DEVICE_EVENTS, FRAMES, JOINT_STATES
from gemelo.tools.bench.figures import quantile
from gemelo.tools.bench.handshake import joins
from gemelo.tools.bench.latency import follow, sharp_start
from gemelo.tools.bench.stack import Running, has_mosquitto
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.hosts.checks import load_site
from gemelo.tools.stack.stack import Stack
from tests.stack.links import SITE
from tests.stack.namespaces import Hosts, Lab

MOVES, WATCHED = 30, 10.0  # [s] of frames
PROCESSES = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher")
MEASURE = (sys.executable, "-m", "tests.stack.far_figures", "measure")


def measure() -> dict[str, list[float]]:
    """All samples [ms] of one client, whose deployment is in the environment."""
    deployment = load_deployment(None)
    arm = load_arm(project_root() / deployment.robot)
    took: dict[str, list[float]] = {"handshake_ms": joins(deployment.router), "move_accept_to_first_step_ms": []}
    with Node("figures", deployment, robot=arm.name) as node:
        frames: list[float] = []
        node.subscribe(FRAMES, lambda said: frames.append((node.now() - _stamp(said)) * 1e-6))
        node.wait(WATCHED)
        took["state_to_frame_ms"] = frames[10:]
        started: list[DeviceEvent] = []
        node.subscribe(DEVICE_EVENTS, lambda said: started.append(said) if said.event == "started" else None)
        states = node.latest(JOINT_STATES)
        for number in range(MOVES):
            node.wait(0.2)
            started.clear()
            trajectory = sharp_start(arm, states.message.position, (-1.0) ** number)
            accepted = follow(Running(None, deployment, arm, node), trajectory)
            took["move_accept_to_first_step_ms"].append((started[0].stamp - accepted) * 1e-6)
    return took


def _stamp(frames: FrameTransforms) -> int:
    return max(each.stamp for each in frames.transforms)


def far(folder: Path) -> dict[str, list[float]]:
    file = folder / "lab.toml"
    file.write_text(SITE)
    site = load_site(file, project_root())
    with Hosts(site) as hosts, Lab(site, hosts, folder / "out") as lab:
        return _measured(hosts.command("desk", *MEASURE), lab.environment("desk", "rm1"))


def near() -> dict[str, list[float]]:
    with Stack(broker="mosquitto", processes=PROCESSES) as stack:
        return _measured(MEASURE, stack.environment)


def _measured(command: tuple[str, ...], environment: dict[str, str]) -> dict[str, list[float]]:
    done = subprocess.run(command, cwd=project_root(), env=environment, capture_output=True, text=True, timeout=120.0)
    assert done.returncode == 0, done.stderr
    samples: dict[str, list[float]] = json.loads(done.stdout.splitlines()[-1])
    return samples


def main() -> None:
    """The command."""
    if os.geteuid() != 0 or not has_mosquitto():
        sys.exit("network namespaces are root's, and mosquitto must be installed")
    with tempfile.TemporaryDirectory() as folder:
        of_hosts, of_one = far(Path(folder)), near()
    rows = [
        (name, *(f"{quantile(each[name], share):.2f}" for each in (of_hosts, of_one) for share in (0.5, 0.99)))
        for name in of_hosts
    ]  # fmt: skip
    print(table(("figure", "hosts, TLS: median", "p99", "loopback: median", "p99"), rows))


if __name__ == "__main__":
    print(json.dumps(measure())) if sys.argv[1:] == ["measure"] else main()
