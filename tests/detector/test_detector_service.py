"""The process: images in, things out; and what it does with an image that is none."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.cell.camera_model import believed_info
from gemelo.libraries.arm.cell.cell_file import Cell, load_cell
from gemelo.libraries.arm.frames.transforms import compose, from_message, from_rpy, inverse, to_message
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.cell import VirtualSource
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.detections import Detections
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import JOINT_STATES, LOG, camera_detections, camera_image, camera_info
from gemelo.services.camera.sources.source import encoded
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera
from gemelo.services.camera.virtual.world import CameraWorld
from gemelo.services.detector.images import NoPicture, decoded
from gemelo.services.detector.main import Places, run
from tests.runtime.support import hear, spinning
from tests.runtime.test_clock_offset import Skewed


@pytest.fixture
def arm(rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder)


@pytest.fixture
def cell(arm: ArmDescription) -> Cell:
    return load_cell(arm.folder / "cell.toml", arm)


@pytest.fixture
def deployment(cell: Cell, tmp_path: Path) -> Deployment:
    return load_deployment(environ={"GEMELO_PATHS_RUN": str(tmp_path / "run"), "GEMELO_CELL": str(cell.path)})


@contextmanager
def running(deployment: Deployment, network: MemoryNetwork | None = None) -> Iterator[Node]:
    """The detector's process as a thread, and a node that stands for the camera's."""
    network = network or MemoryNetwork()
    with (
        Node("detector", deployment, bus=MemoryBus(network)) as node,
        Node("camera", deployment, bus=MemoryBus(network)) as camera,
    ):
        thread = threading.Thread(target=run, args=(node, deployment))
        thread.start()
        try:
            yield camera
        finally:
            node.stop()
            thread.join(60.0)


def picture(arm: ArmDescription, cell: Cell) -> tuple[bytes, CameraInfo]:
    """The sample cell as its camera sees it, with the arm aside."""
    record, world = cell.camera("overhead"), CameraWorld(arm, cell)
    world.on_joint_state(JointState(stamp=1, name=arm.joint_names, position=arm.named_states["folded"]))
    assert isinstance(record.source, VirtualSource)
    info = believed_info(cell, record, arm.base_frame)
    image = VirtualCamera(record, record.source, info, world.snapshot).image(world.snapshot())
    return encoded(np.ascontiguousarray(image[..., ::-1])), info


def test_an_image_becomes_the_things_in_it_and_none_becomes_a_sentence(
    arm: ArmDescription, cell: Cell, deployment: Deployment
) -> None:
    data, info = picture(arm, cell)
    with running(deployment) as camera:
        found: list[Detections] = []
        log: list[LogRecord] = []
        camera.subscribe(camera_detections("overhead"), found.append)
        camera.subscribe(LOG, log.append)
        image, lens = camera.publisher(camera_image("overhead")), camera.publisher(camera_info("overhead"))
        lens.put(info)

        def put(stamp: int, payload: bytes, **fields: object) -> None:
            camera.wait(0.3)  # faster ones are left out
            values = {"camera": "overhead", "width": 640, "height": 480, "data": payload} | fields
            image.put(CameraImage(stamp=stamp, **values))  # type: ignore[arg-type]

        def put_and_hear() -> bool:
            put(5, data)
            return hear(camera, lambda: found, 0.3)

        assert any(put_and_hear() for _ in range(30))
        assert found[0].stamp == 5
        assert {"cup", "red_block", "blue_block", "tray"} <= {item.name for item in found[0].items}
        put(6, b"no picture")
        assert hear(camera, lambda: any("no JPEG" in record.text for record in log))
        put(7, bytes(30), encoding="rgb8", width=4, height=4)
        assert hear(camera, lambda: any("4 x 4 pixels" in record.text for record in log))
        found.clear()
        put(8, data)
        assert hear(camera, lambda: found and found[-1].stamp == 8)


def test_without_a_cell_it_stands_aside(tmp_path: Path) -> None:
    deployment = load_deployment(environ={"GEMELO_PATHS_RUN": str(tmp_path / "run")})
    with running(deployment) as camera:
        ready = tmp_path / "run"
        assert hear(camera, lambda: any("detector" in path.name for path in ready.rglob("*")))


def test_a_camera_on_a_link_is_where_the_link_was_when_it_took_the_image(arm: ArmDescription) -> None:
    local = ((0.02, 0.0, 0.03), from_rpy(0.1, 0.2, 0.3))
    info = CameraInfo(
        name="hand", parent=arm.tool_frame, parent_from_camera=to_message(local), is_mounted=True, width=4, height=4
    )
    places = Places(arm)
    for step in range(10):
        position = tuple(value + 0.01 * step for value in arm.named_states["home"])
        places.on_joint_state(JointState(stamp=step * 20_000_000, name=arm.joint_names, position=position))
    at = tuple(value + 0.03 for value in arm.named_states["home"])
    links = link_transforms(arm.model, dict(zip(arm.joint_names, at, strict=True)))
    expected = compose(compose(inverse(links[arm.base_frame]), links[arm.tool_frame]), local)
    found = places.base_from_camera(info, 3 * 20_000_000 + 1)
    assert found is not None
    assert found[:3, 3] == pytest.approx(expected[0])
    assert places.base_from_camera(info, 10**12) is None  # nobody knows where it was
    assert places.base_from_camera(CameraInfo(name="new", parent=arm.base_frame), 0) is None  # never measured


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (CameraImage(), because("detect.image.jpeg", size=0)),
        (CameraImage(encoding="bmp", data=b"x"), because("detect.image.encoding", encoding="bmp")),
        (
            CameraImage(encoding="mono8", width=2, height=2, data=b"x"),
            because("detect.image.pixels", size=1, width=2, height=2, encoding="mono8"),
        ),
    ],
)
def test_what_is_no_image_is_refused(image: CameraImage, why: Reason) -> None:
    with pytest.raises(NoPicture) as refused:
        decoded(image)
    assert refused.value.reason == why


def test_grey_and_coloured_rows_are_read() -> None:
    grey = decoded(CameraImage(encoding="mono8", width=2, height=1, data=b"\x01\x02"))
    assert grey[0, 1].tolist() == [2, 2, 2]
    rgb = decoded(CameraImage(encoding="rgb8", width=1, height=1, data=b"\x01\x02\x03"))
    assert rgb[0, 0].tolist() == [1, 2, 3]


@pytest.mark.parametrize("ahead", [0.0, 5.0, -5.0])
def test_an_image_and_the_state_of_its_moment_meet_whatever_the_clocks_of_their_hosts_say(
    arm: ArmDescription, cell: Cell, tmp_path: Path, ahead: float
) -> None:
    """The camera rides on the tool, so where a thing is depends on the joint state of the image's own moment."""
    text = cell.path.read_text().replace('name = "overhead"', f'name = "hand"\nparent = "{arm.tool_frame}"', 1)
    (tmp_path / "cell.toml").write_text(text)
    environ = {"GEMELO_PATHS_RUN": str(tmp_path / "run"), "GEMELO_CELL": str(tmp_path / "cell.toml")}
    deployment = load_deployment(environ=environ)
    data, seen = picture(arm, cell)  # its lens; the camera is now on the tool, at the place where the other one hangs
    info = replace(seen, name="hand", parent=arm.tool_frame)
    network = MemoryNetwork()
    with running(deployment, network) as camera, ExitStack() as living:
        gateway = Node("stepper_gateway", deployment, bus=MemoryBus(network))
        living.enter_context(gateway)
        for node, seconds in ((camera, ahead), (gateway, -ahead)):
            Skewed(seconds, 1e-4).on(node)
        living.enter_context(spinning(gateway))
        living.callback(gateway.stop)
        found: list[Detections] = []
        camera.subscribe(camera_detections("hand"), found.append)
        image, lens = camera.publisher(camera_image("hand")), camera.publisher(camera_info("hand"))
        states = gateway.publisher(JOINT_STATES)
        lens.put(info)
        stood = {}  # where the joints were, by the image's stamp
        for turn in range(60):
            at = arm.named_states["ready" if turn % 2 else "left"]
            stamp = gateway.now()
            states.put(JointState(stamp=stamp, name=arm.joint_names, position=at))
            moment = camera.now()
            stood[moment] = at
            camera.wait(0.3)
            image.put(CameraImage(stamp=moment, camera="hand", width=640, height=480, encoding="jpeg", data=data))
            if hear(camera, lambda: any(item.is_located for each in found for item in each.items), 0.3):
                break
        (shown, *_) = (each for each in found if any(item.is_located for item in each.items))
        links = link_transforms(arm.model, dict(zip(arm.joint_names, stood[shown.stamp], strict=True)))
        base_from_tool = compose(inverse(links[arm.base_frame]), links[arm.tool_frame])
        for item in (each for each in shown.items if each.is_located):
            tool_from_camera = from_message(info.parent_from_camera)
            expected = compose(compose(base_from_tool, tool_from_camera), from_message(item.camera_from_thing))
            assert from_message(item.base_from_thing)[0] == pytest.approx(expected[0], abs=1e-6)
