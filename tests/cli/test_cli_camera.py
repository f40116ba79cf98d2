"""`gemelo camera list | view`: without a stack, without a cell, and with cameras that speak."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraCondition, CameraImage, CameraInfo, CameraStatus
from gemelo.schemas.detections import Detection, Detections
from gemelo.schemas.topics import camera_detections, camera_image, camera_info, camera_status
from gemelo.tools.cli.camera import camera
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.main import run
from tests.runtime.support import free_port

PICTURE = cv2.imencode(".jpg", np.full((48, 64, 3), 60, np.uint8))[1].tobytes()


@pytest.fixture
def cell(rm1_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The sample cell, and no stack."""
    monkeypatch.setenv("GEMELO_CELL", str(rm1_folder / "cell.toml"))
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(free_port()))
    return rm1_folder / "cell.toml"


@pytest.fixture
def devices(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Folders in place of /dev and /sys, with nothing plugged in."""
    for name, value in (("DEVICES", tmp_path), ("BY_ID", tmp_path / "by-id"), ("NAMES", tmp_path / "names")):
        monkeypatch.setattr(camera, name, value)
    return tmp_path


@pytest.fixture
def stack(cell: Path, devices: Path, rm1, monkeypatch: pytest.MonkeyPatch) -> Iterator[Node]:
    """A node that stands for the process `camera`, heard by the command over a bus in memory."""
    network, deployment = MemoryNetwork(), load_deployment()
    with (
        Node("camera", deployment, bus=MemoryBus(network)) as speaker,
        Node("cli-1", deployment, bus=MemoryBus(network)) as node,
    ):

        @contextmanager
        def connected(robot: object = None) -> Iterator[CommandSession]:
            yield CommandSession(deployment, rm1, node)

        monkeypatch.setattr(camera, "connect", connected)
        yield speaker


def say(speaker: Node, condition: CameraCondition, text: str = "") -> None:
    status = CameraStatus(camera="overhead", condition=condition, text=text, fps=5.0)
    speaker.publisher(camera_info("overhead")).put(CameraInfo(name="overhead", is_mounted=True))
    speaker.publisher(camera_status("overhead")).put(status)


def test_without_a_stack_what_is_plugged_in_and_what_is_asked_for_are_listed(cell, devices, capsys) -> None:
    (devices / "video0").touch()
    (devices / "video1").touch()  # the metadata of the same camera
    (devices / "by-id").mkdir()
    (devices / "by-id" / "usb-Cheap_Webcam-video-index0").symlink_to(devices / "video0")
    (devices / "names" / "video0").mkdir(parents=True)
    (devices / "names" / "video0" / "name").write_text("Cheap Webcam\n")
    assert run(["camera", "list"]) is ExitCode.OK
    said = capsys.readouterr().out
    assert re.search(r"by-id/usb-Cheap_Webcam-video-index0 +Cheap Webcam", said)
    assert "video1" not in said
    assert re.search(r"overhead +virtual +640 x 480 +5 +- +- +- +not heard", said)


def test_no_camera_and_no_cell_are_said_with_the_remedy(devices, monkeypatch, capsys) -> None:
    monkeypatch.setenv("GEMELO_CELL", "")
    assert run(["camera", "list"]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "no camera is plugged in" in said
    assert "no cell file: write one (urdf/rm1/cell.toml is a sample)" in said
    assert run(["camera", "view"]) is ExitCode.USAGE


def test_a_wrong_cell_file_and_a_wrong_camera_are_refused_before_the_stack_is_asked(
    cell, devices, tmp_path, monkeypatch, capsys
) -> None:
    assert run(["camera", "view", "overhed"]) is ExitCode.USAGE
    assert 'no camera "overhed": did you mean "overhead"?' in capsys.readouterr().err
    assert run(["camera", "view", "--save", str(tmp_path / "none" / "a.jpg")]) is ExitCode.USAGE
    assert "there is no folder" in capsys.readouterr().err
    (tmp_path / "cell.toml").write_text("tabel = 0.0")
    monkeypatch.setenv("GEMELO_CELL", str(tmp_path / "cell.toml"))
    assert run(["camera", "list"]) is ExitCode.USAGE
    assert 'line 1: unknown key `tabel`; did you mean "table"?' in capsys.readouterr().err


def test_a_camera_that_streams_is_listed_with_its_rate_and_what_is_known_of_it(stack: Node, capsys) -> None:
    say(stack, CameraCondition.STREAMING)
    assert run(["camera", "list"]) is ExitCode.OK
    assert re.search(r"overhead.* 5 +5 +assumed +measured +streaming", capsys.readouterr().out)
    assert run(["camera", "list", "--json"]) is ExitCode.OK
    listed = json.loads(capsys.readouterr().out)
    assert listed["cameras"][0]["status"]["condition"] == "streaming"


def test_what_is_wrong_with_a_camera_is_said_in_its_own_words(stack: Node, capsys) -> None:
    say(stack, CameraCondition.TAKEN, 'camera "overhead": process 12 (cheese) has /dev/video0: end that program')
    assert run(["camera", "list"]) is ExitCode.OK
    assert "process 12 (cheese) has /dev/video0: end that program" in capsys.readouterr().out
    assert run(["camera", "view"]) is ExitCode.FAILED
    assert "process 12 (cheese)" in capsys.readouterr().err


def test_a_view_is_saved_with_what_was_found_in_it(stack: Node, tmp_path: Path, capsys, monkeypatch) -> None:
    cup = Detection(name="cup", corners=((10.0, 10.0), (50.0, 10.0), (50.0, 40.0), (10.0, 40.0)), sigma=0.0002)

    def answer(node_wait=Node.wait):
        def wait(node: Node, seconds: float) -> None:  # while the command waits, the camera speaks
            stack.publisher(camera_detections("overhead")).put(Detections(camera="overhead", items=(cup,)))
            stack.publisher(camera_image("overhead")).put(
                CameraImage(camera="overhead", width=64, height=48, data=PICTURE)
            )
            node_wait(node, seconds)

        return wait

    say(stack, CameraCondition.STREAMING)
    monkeypatch.setattr(Node, "wait", answer())
    file = tmp_path / "view.jpg"
    assert run(["camera", "view", "overhead", "--save", str(file)]) is ExitCode.OK
    said = capsys.readouterr().out
    assert f"overhead: 64 x 48, 1 kB, 5 Hz -> {file}" in said
    assert "found: cup ± 0.20 mm" in said
    saved = cv2.imread(str(file))
    assert saved[25, 10, 1] > 150  # the outline is green
    assert saved[25, 30].max() < 90


def test_the_picture_on_a_terminal_has_two_points_a_character() -> None:
    picture = np.zeros((48, 64, 3), np.uint8)
    picture[:24] = (0, 0, 255)  # red above, black below
    lines = camera.on_terminal(cv2.imencode(".png", picture)[1].tobytes(), 32, 100).split("\n")
    assert len(lines) == 12
    assert all(line.count("▀") == 32 for line in lines)
    assert "38;2;255;0;0" in lines[0]
    assert "38;2;255;0;0" not in lines[-1]


@pytest.mark.parametrize(
    "words",
    [
        ["camera", "calibrate", "--images", "{}/shot"], ["camera", "print", "chess", "--to", "{}/shot/board.pdf"],
        ["camera", "view", "--save", "{}/shot/table.jpg"], ["collision", "fit", "{}/shot"],
        ["collision", "matrix", "{}/shot"],
    ],
)  # fmt: skip
def test_a_folder_that_is_not_there_is_said_with_the_one_that_is(words, tmp_path, cell, devices, capsys) -> None:
    (tmp_path / "shots").mkdir()
    assert run([word.format(tmp_path) for word in words]) is ExitCode.USAGE
    said = capsys.readouterr().err
    assert f"there is no folder {tmp_path}/shot: did you mean {tmp_path}/shots?" in said
    (tmp_path / "shot").write_text("")
    assert run([word.format(tmp_path) for word in words]) is ExitCode.USAGE
    assert "is no folder" in capsys.readouterr().err


@pytest.mark.parametrize("board", ["a chessboard without tags", "tags of DICT_4X4_50"])
def test_shots_of_another_board_are_said_to_be_that(board, tmp_path, cell, devices, capsys) -> None:
    shot = np.full((480, 640), 255, np.uint8)
    if board.startswith("tags"):
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
        shot[100:200, 100:200] = cv2.aruco.generateImageMarker(dictionary, 3, 100)
    else:
        squares = np.add.outer(np.arange(6), np.arange(8)) % 2
        shot[60:360, 100:500] = np.kron(squares, np.ones((50, 50))) * 255
    for number in range(2):
        cv2.imwrite(str(tmp_path / f"{number}.png"), shot)
    assert run(["camera", "calibrate", "--images", str(tmp_path)]) is ExitCode.FAILED
    said = capsys.readouterr().out
    assert said.count(f"the image shows {board}") == 1
    assert "print `gemelo camera print chess`" in said
