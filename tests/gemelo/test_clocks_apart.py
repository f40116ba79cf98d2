"""Hosts whose clocks are seconds apart and drift: a script and its camera decide as with one clock."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from gemelo.api import seeing
from gemelo.api.errors import Refused
from gemelo.api.scene import Scene
from gemelo.api.seeing import Eyes
from gemelo.api.session import Session
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraCondition, CameraStatus
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.detections import Detection, DetectionKind, Detections
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES, camera_detections, camera_status
from tests.runtime.support import spinning
from tests.runtime.test_clock_offset import Skewed

MS = 1_000_000
APART = [(0.0, 0.0), (5.0, 1e-4), (-5.0, -1e-4)]  # [s] ahead, [s/s] fast


@pytest.fixture
def deployment(tmp_path: Path, rm1_folder: Path) -> Deployment:
    paths = PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out"))
    return Deployment(robot=str(rm1_folder), cell=str(rm1_folder / "cell.toml"), paths=paths)


@contextmanager
def hosts(deployment: Deployment, *skewed: tuple[str, Skewed]) -> Iterator[tuple[Session, dict[str, Node]]]:
    """A script's session, and nodes on hosts with other clocks."""
    network = MemoryNetwork()
    with ExitStack() as living:
        nodes = {}
        for name, clock in skewed:
            node = living.enter_context(Node(name, deployment, robot="rm1", bus=MemoryBus(network)))
            nodes[name] = clock.on(node)
        for node in nodes.values():
            living.enter_context(spinning(node))
            living.callback(node.stop)
        arm = load_arm(Path(deployment.robot))
        session = Session(deployment, arm, Node("script", deployment, robot="rm1", bus=MemoryBus(network)))
        living.callback(session.close)
        yield session, nodes


@pytest.mark.parametrize(("ahead", "drift"), APART)
def test_what_a_script_sees_after_a_change_was_measured_after_it(deployment, ahead, drift):
    with hosts(deployment, ("stepper_gateway", Skewed(ahead, drift))) as (session, nodes):
        gateway = nodes["stepper_gateway"]
        states = gateway.publisher(JOINT_STATES)
        names = session.description.joint_names

        def put(age: int, place: float) -> None:
            states.put(JointState(stamp=gateway.now() - age, name=names, position=(place, 0.0, 0.0)))

        latest = session.latest(JOINT_STATES)
        put(0, 1.0)
        assert session.wait_for(lambda: latest.message is not None, 2.0)
        session.changed()
        put(100 * MS, 1.0)  # measured before, and late on its way
        later = threading.Timer(0.1, put, (0, 2.0))
        later.start()
        assert session.newest(JOINT_STATES).position[0] == 2.0
        later.join()


def seen(stamp: int, x: float) -> Detections:
    place = Transform(translation=(x, 0.1, 0.04), rotation=(0.0, 0.0, 0.0, 1.0))
    cup = Detection(name="cup", kind=DetectionKind.TAG, sigma=1e-4, is_located=True, base_from_thing=place)
    return Detections(stamp=stamp, camera="overhead", items=(cup,))


@contextmanager
def speaking(
    session: Session,
    nodes: dict[str, Node],
    late: int,
    silent: float = 0.0,
    condition: CameraCondition = CameraCondition.STREAMING,
) -> Iterator[None]:
    """An arm that stands, and images that come `late` [ns]; those that were taken before now show the cup elsewhere.

    The camera is in that condition; the detector says nothing for the first `silent` [s].
    """
    gateway, camera, detector = (nodes[name] for name in ("stepper_gateway", "camera", "detector"))
    states, found = gateway.publisher(JOINT_STATES), detector.publisher(camera_detections("overhead"))
    status = camera.publisher(camera_status("overhead"))
    names = session.description.joint_names
    end = threading.Event()

    def speak() -> None:
        began = camera.now()
        while not end.wait(0.02):
            states.put(JointState(stamp=gateway.now(), name=names, position=(0.0,) * 3, velocity=(0.0,) * 3))
            status.put(CameraStatus(stamp=camera.now(), camera="overhead", condition=condition))
            stamp = camera.now() - late
            if camera.now() - began >= 1e9 * silent:
                found.put(seen(stamp, 0.1 if stamp < began else 0.2))

    speaker = threading.Thread(target=speak)
    speaker.start()
    try:
        yield
    finally:
        end.set()
        speaker.join()


def clocks_of_cameras(ahead: float, drift: float) -> tuple[tuple[str, Skewed], ...]:
    return (
        ("stepper_gateway", Skewed(-ahead, -drift)), ("camera", Skewed(ahead, drift)), ("detector", Skewed(2 * ahead)),
    )  # fmt: skip


@pytest.mark.parametrize(("ahead", "drift"), APART)
def test_a_thing_is_where_images_show_it_that_were_taken_after_the_arm_had_come_to_rest(deployment, ahead, drift):
    with hosts(deployment, *clocks_of_cameras(ahead, drift)) as (session, nodes), speaking(session, nodes, 200 * MS):
        (cup,) = Eyes(session, Scene(session)).detect("cup", "overhead", False)
        assert cup.pose.position[0] == pytest.approx(0.2)


@pytest.mark.parametrize(("ahead", "drift"), APART)
def test_images_older_than_half_a_second_are_refused_with_their_age(deployment, ahead, drift):
    with hosts(deployment, *clocks_of_cameras(ahead, drift)) as (session, nodes), speaking(session, nodes, 900 * MS):
        late = r'"overhead" is (0\.9|1\.\d) s old when it comes \(at most 0\.5\)'
        with pytest.raises(Refused, match=late) as refused:
            Eyes(session, Scene(session)).detect("cup", "overhead", False)
        assert (refused.value.check, refused.value.subject) == ("camera", "overhead")


def test_a_detector_that_comes_late_to_its_images_is_waited_for_while_the_camera_streams(deployment, monkeypatch):
    monkeypatch.setattr(seeing, "PATIENCE", -0.5)  # with the time that five images take, half a second in all
    with (
        hosts(deployment, *clocks_of_cameras(0.0, 0.0)) as (session, nodes),
        speaking(session, nodes, 20 * MS, silent=1.5),
    ):
        (cup,) = Eyes(session, Scene(session)).detect("cup", "overhead", False)
        assert cup.pose.position[0] == pytest.approx(0.2)


def test_it_is_not_waited_for_where_the_camera_gives_no_images(deployment, monkeypatch):
    monkeypatch.setattr(seeing, "PATIENCE", -0.5)
    with (
        hosts(deployment, *clocks_of_cameras(0.0, 0.0)) as (session, nodes),
        speaking(session, nodes, 20 * MS, silent=1.5, condition=CameraCondition.FROZEN),
        pytest.raises(Refused, match=r"within 0\.5 s"),
    ):
        Eyes(session, Scene(session)).detect("cup", "overhead", False)
