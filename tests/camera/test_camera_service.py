"""The process: images, lens, condition and truth on the bus; and what it does without a cell or a camera."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE, write_measured
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraCondition, CameraImage, CameraInfo, CameraStatus
from gemelo.schemas.cell import Calibration, MeasuredCamera
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.detections import Detections
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES, camera_image, camera_info, camera_status, camera_truth
from gemelo.services.camera.main import run
from gemelo.services.camera.sources.source import encoded
from tests.runtime.support import hear, until

CELL = """
[[camera]]
name = "above"
size = [160, 120]
fps = 20.0
position = [0.3, 0.0, 0.4]
look_at = [0.3, 0.0, 0.0]
[camera.source]
kind = "virtual"

[[camera]]
name = "shelf"
size = [64, 48]
fps = 50.0
[camera.source]
kind = "folder"
path = "pictures"

[[thing]]
name = "cup"
kind = "tag"
id = 1
size = 0.06
grasp_width = 0.03
position = [0.3, 0.0, 0.0]
"""


@pytest.fixture
def deployment(tmp_path: Path) -> Deployment:
    (tmp_path / "cell.toml").write_text(CELL)
    environ = {"GEMELO_PATHS_RUN": str(tmp_path / "run"), "GEMELO_CELL": str(tmp_path / "cell.toml")}
    return load_deployment(environ=environ)


@contextmanager
def running(deployment: Deployment) -> Iterator[tuple[Node, Node]]:
    """The camera's process as a thread, and the gateway, which listens."""
    network = MemoryNetwork()
    with (
        Node("camera", deployment, bus=MemoryBus(network)) as node,
        Node("stepper_gateway", deployment, bus=MemoryBus(network)) as listener,
    ):
        thread = threading.Thread(target=run, args=(node, deployment))
        thread.start()
        try:
            assert until(lambda: node.is_ready or not thread.is_alive(), 20.0)
            yield node, listener
        finally:
            node.stop()
            thread.join(60.0)
            assert not thread.is_alive()


def test_images_lens_and_truth_of_the_virtual_camera_are_heard(deployment: Deployment, rm1: ArmDescription) -> None:
    images: list[CameraImage] = []
    infos: list[CameraInfo] = []
    truths: list[Detections] = []
    with running(deployment) as (node, listener):
        listener.subscribe(camera_image("above"), images.append)
        listener.subscribe(camera_info("above"), infos.append)
        listener.subscribe(camera_truth("above"), truths.append)
        stamp = node.now()
        joints = listener.publisher(JOINT_STATES)
        joints.put(JointState(stamp=stamp, name=rm1.joint_names, position=rm1.named_states["left"]))
        assert hear(listener, lambda: len(images) >= 3 and infos and truths and images[-1].stamp == stamp)
        (info, image), truth = (infos[-1], images[-1]), truths[-1]
        assert (info.parent, info.is_calibrated, info.is_mounted) == ("base_link", True, True)
        picture = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR)
        assert picture.shape == (120, 160, 3)
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36H11)
        corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(picture)
        assert numbers.ravel().tolist() == [1]
        assert truth.items[0].name == "cup"
        assert np.abs(corners[0].reshape(4, 2) - np.array(truth.items[0].corners)).max() < 1.5


def test_what_the_wizard_measures_is_told_without_a_restart(deployment: Deployment) -> None:
    infos: list[CameraInfo] = []
    with running(deployment) as (_, listener):
        listener.subscribe(camera_info("above"), infos.append)
        assert hear(listener, lambda: infos)
        matrix = (200.0, 0.0, 80.0, 0.0, 200.0, 60.0, 0.0, 0.0, 1.0)
        lens = Calibration(size=(160, 120), intrinsics=matrix, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
        file = Path(deployment.cell).with_name(CAMERA_FILE)
        write_measured(file, [MeasuredCamera(name="above", calibration=lens)])
        assert hear(listener, lambda: infos[-1].intrinsics == matrix)
        file.write_text("[[camera]]\nname = 3\n")  # a spoilt file changes nothing
        known = len(infos)
        listener.wait(1.2)
        assert len(infos) == known


def test_a_folder_that_is_missing_is_said_and_its_images_come_when_it_is_there(deployment: Deployment) -> None:
    said: list[CameraStatus] = []
    images: list[CameraImage] = []
    with running(deployment) as (_, listener):
        listener.subscribe(camera_status("shelf"), said.append)
        listener.subscribe(camera_image("shelf"), images.append)
        assert hear(listener, lambda: said and said[-1].condition is CameraCondition.MISSING)
        assert 'camera "shelf": there is no folder' in said[-1].text
        folder = Path(deployment.cell).with_name("pictures")
        folder.mkdir()
        (folder / "1.jpg").write_bytes(encoded(np.zeros((48, 64, 3), np.uint8)))
        assert hear(listener, lambda: said[-1].condition is CameraCondition.STREAMING and images)


def test_without_a_cell_it_stands_aside_and_is_ready(tmp_path: Path) -> None:
    with running(load_deployment(environ={"GEMELO_PATHS_RUN": str(tmp_path)})) as (node, _):
        assert node.is_ready
        assert not any(key.startswith("camera/") for key in node.info().publishes)


def test_a_cell_file_that_is_wrong_ends_the_process_with_its_line(deployment: Deployment) -> None:
    Path(deployment.cell).write_text(CELL.replace("fps = 20.0", "fbs = 20.0"))
    with (
        Node("camera", deployment, bus=MemoryBus(MemoryNetwork())) as node,
        pytest.raises(DescriptionError, match=r"line 5: unknown key `camera\[0\].fbs`"),
    ):
        run(node, deployment)
