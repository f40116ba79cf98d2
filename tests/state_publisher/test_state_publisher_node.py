"""The state publisher as a node on a bus: description latched, frames from fresh joint states, ready only then."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.wire import limit_of
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import remedy
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


def test_files_that_are_too_large_to_be_published_are_named(tmp_path: Path, rm1: ArmDescription):
    folder = Path(shutil.copytree(rm1.folder, tmp_path / "rm1"))
    urdf = folder / rm1.urdf_path.relative_to(rm1.folder)
    urdf.write_text(urdf.read_text() + f"<!--{'x' * limit_of('RobotDescription')}-->\n")
    deployment = Deployment(robot=str(folder), paths=PathsSection(run=str(tmp_path)))
    with (
        Node("state_publisher", deployment, bus=MemoryBus(MemoryNetwork()), stop=ShutdownRequest()) as node,
        pytest.raises(ConfigurationError) as refused,
    ):
        run(node, deployment)
    why = refused.value.reason
    assert (why.code, why.values) == ("message.robot", {"folder": str(folder)})
    (cause,) = why.causes
    assert (cause.code, cause.values["message"]) == ("message.too_large", "RobotDescription")
    assert cause.remedies == (remedy("simplify_urdf"),)
    assert str(why).startswith(f"{folder}: its files cannot be published: {cause.values['size']} bytes: a Robot")


def test_frames_come_with_the_states_stamp_and_readiness_with_them(listener: Node, rm1: ArmDescription, tmp_path: Path):
    frames, states = listener.latest(FRAMES), listener.publisher(JOINT_STATES)
    assert not (tmp_path / "state_publisher.ready").exists()
    for stamp in range(1, 11):
        states.put(JointState(stamp=stamp, name=rm1.joint_names, position=(0.1, 0.2, 0.03)))
        listener.wait(0.03)
    assert frames.message is not None
    assert {frame.stamp for frame in frames.message.transforms} == {10}
    assert (tmp_path / "state_publisher.ready").exists()
