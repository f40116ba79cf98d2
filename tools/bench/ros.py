"""Figures of the bridge to ROS 2: what it costs, and how much later a ROS subscriber has a joint state than our bus."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import psutil

from gemelo.libraries.ros2.messages import nanoseconds
from gemelo.libraries.ros2.types import decode, ros_type
from gemelo.libraries.runtime.bus.zenoh_bus import router_answers
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.libraries.runtime.ros_wire.names import NodeName
from gemelo.libraries.runtime.ros_wire.ros_node import RosNode
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import FRAMES, JOINT_STATES
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.stack import cpu_seconds
from gemelo.tools.stack.stack import free_ports

CPU_GOAL = FigureGoal(median=4.0)  # [% of one core]
RATE, JOINTS = 50.0, 6  # [Hz] of states and frames; of an arm
SETTLE, WINDOW, WINDOWS = 2.0, 4.0, 5  # [s], [s]; how many
READY = 30.0  # [s]
JOINT_STATE = "sensor_msgs/msg/JointState"
LATE = 1e-6  # [ms] in a nanosecond


class Arrivals(NamedTuple):
    """How long each joint state took [ms]."""

    ros: list[float]  # to a subscriber of ROS
    own: list[float]  # to one of our bus


class RunningBridge(NamedTuple):
    """A bridge between a bus with states and frames, and a ROS subscriber."""

    process: psutil.Process
    arrivals: Arrivals


def ros_bridge_cpu_percent() -> Figure:
    """CPU time [% of one core] of the bridge with joint states and frames of six joints at 50 Hz and one subscriber."""
    with running_bridge() as bridge:
        samples = []
        for _ in range(WINDOWS):
            before, began = cpu_seconds([bridge.process]), time.monotonic()
            time.sleep(WINDOW)
            samples.append(100.0 * (cpu_seconds([bridge.process]) - before) / (time.monotonic() - began))
        memory = bridge.process.memory_info().rss / 1e6
    return of_samples(samples, CPU_GOAL, {"memory [MB]": memory}, f"{WINDOWS} windows of {WINDOW:g} s")


def ros_latency_ms() -> Figure:
    """Time [ms] from the stamp of a joint state to a ROS subscriber behind the bridge and its router."""
    with running_bridge() as bridge:
        bridge.arrivals.ros.clear()
        bridge.arrivals.own.clear()
        time.sleep(WINDOW * WINDOWS)
        ros, own = list(bridge.arrivals.ros), list(bridge.arrivals.own)
    if not own:
        raise NotMeasured("no joint state came over our own bus")
    reference = {"our bus, median": quantile(own, 0.5), "our bus, p99": quantile(own, 0.99)}
    return of_samples(ros, None, reference, f"{len(ros)} joint states at {RATE:g} Hz; both in this process")


@contextmanager
def running_bridge() -> Iterator[RunningBridge]:
    """Two routers, the bridge between them, and who speaks and listens, until this is left."""
    with tempfile.TemporaryDirectory(prefix="gemelo-ros-") as folder, ExitStack() as opened:
        own_port, ros_port = free_ports(2)
        locator, run = f"tcp/127.0.0.1:{ros_port}", Path(folder)
        for port in (own_port, ros_port):
            opened.enter_context(_process("router", run / str(port), {"GEMELO_ROUTER_PORT": str(port)}))
            _wait(port)
        deployment = Deployment(router=RouterSection(port=own_port), paths=PathsSection(run=folder, out=folder))
        arrivals = Arrivals([], [])
        opened.enter_context(_speaking(deployment, arrivals.own))
        environment = {"GEMELO_ROUTER_PORT": str(own_port), "GEMELO_ROS_ROUTER": locator, "GEMELO_ROBOT": "urdf/rm1"}
        bridge = opened.enter_context(_process("ros_bridge", run / "bridge", environment))
        listener = RosNode(locator, NodeName("bench"), lambda task: task())
        opened.callback(listener.close)

        def on_message(payload: bytes) -> None:
            stamp = nanoseconds(decode(JOINT_STATE, payload).header.stamp)
            arrivals.ros.append((time.time_ns() - stamp) * LATE)

        listener.subscribe("/joint_states", ros_type(JOINT_STATE), on_message)
        end = time.monotonic() + READY
        while not arrivals.ros:
            if time.monotonic() > end:
                raise NotMeasured(f"nothing came over the bridge within {READY:g} s")
            time.sleep(0.05)
        time.sleep(SETTLE)
        yield RunningBridge(bridge, arrivals)


@contextmanager
def _speaking(deployment: Deployment, own: list[float]) -> Iterator[None]:
    """States and frames at `RATE`, and a reader of ours that puts what the states took [ms] into `own`."""
    names, still = tuple(f"joint_{number}" for number in range(JOINTS)), (0.0,) * JOINTS
    options = {"deployment": deployment, "robot": "rm1", "log_level": "error"}
    with (
        Node("stepper_gateway", stop=ShutdownRequest(), **options) as gateway,  # type: ignore[arg-type]
        Node("state_publisher", stop=ShutdownRequest(), **options) as publisher,  # type: ignore[arg-type]
        Node("bench", stop=ShutdownRequest(), **options) as reader,  # type: ignore[arg-type]
    ):
        states, frames = gateway.publisher(JOINT_STATES), publisher.publisher(FRAMES)

        def speak(now: int) -> None:
            states.put(JointState(stamp=now, name=names, position=still, velocity=still))
            moved = tuple(FrameTransform(stamp=now, parent="base_link", child=name) for name in names)
            frames.put(FrameTransforms(transforms=moved))

        reader.subscribe(JOINT_STATES, lambda state: own.append((time.time_ns() - state.stamp) * LATE))
        threads = [threading.Thread(target=gateway.spin, args=(speak, RATE)), threading.Thread(target=reader.spin)]
        for thread in threads:
            thread.start()
        try:
            yield
        finally:
            gateway.stop()
            reader.stop()
            for thread in threads:
                thread.join(READY)


@contextmanager
def _process(name: str, run: Path, environment: dict[str, str]) -> Iterator[psutil.Process]:
    paths = {"GEMELO_PATHS_RUN": str(run), "GEMELO_PATHS_OUT": str(run)}
    process = subprocess.Popen(
        [sys.executable, "-m", f"gemelo.services.{name}.main"],
        cwd=project_root(), env=os.environ | environment | paths,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        yield psutil.Process(process.pid)
    finally:
        process.terminate()
        process.wait(READY)


def _wait(port: int) -> None:
    end = time.monotonic() + READY
    while not router_answers("127.0.0.1", port, 0.1):
        if time.monotonic() > end:
            raise NotMeasured(f"no router within {READY:g} s")
        time.sleep(0.05)
