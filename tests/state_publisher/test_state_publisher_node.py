"""The state publisher as a node on a bus: description latched, frames from fresh joint states, ready only then."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, FRAMES, JOINT_STATES, STATIC_FRAMES
from gemelo.services.state_publisher.main import run


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Node]:
    """A node that joins after a state publisher has started."""
    network, stop = MemoryNetwork(), ShutdownRequest()
    deployment = Deployment(paths=PathsSection(run=str(tmp_path)))

    def publish() -> None:
        with Node("state_publisher", deployment, bus=MemoryBus(network), stop=stop) as node:
            run(node, deployment)

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        with Node("listener", deployment, bus=MemoryBus(network), stop=ShutdownRequest()) as node:
            node.wait(0.3)
            yield node
    finally:
        stop.set()
        thread.join(60.0)
        assert not thread.is_alive()


def test_a_late_joiner_gets_the_description_and_static_frames(listener: Node, rm1: ArmDescription):
    description, static = listener.latest(DESCRIPTION), listener.latest(STATIC_FRAMES)
    listener.wait(0.2)
    assert description.message is not None
    assert description.message.robot == "rm1"
    assert description.message.urdf == rm1.urdf_path.read_text()
    assert static.message is not None


def test_frames_come_with_the_states_stamp_and_readiness_with_them(listener: Node, rm1: ArmDescription, tmp_path: Path):
    frames, states = listener.latest(FRAMES), listener.publisher(JOINT_STATES)
    assert not (tmp_path / "state_publisher.ready").exists()
    for stamp in range(1, 11):
        states.put(JointState(stamp=stamp, name=rm1.joint_names, position=(0.1, 0.2, 0.03)))
        listener.wait(0.03)
    assert frames.message is not None
    assert {frame.stamp for frame in frames.message.transforms} == {10}
    assert (tmp_path / "state_publisher.ready").exists()
