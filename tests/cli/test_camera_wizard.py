"""`gemelo camera print | calibrate | mount`: pages that are read back, a lens from images, a place from touches."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest

from gemelo.api.units import Pose
from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE
from gemelo.libraries.arm.cell.camera_model import believed_info, exact_info
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.vision.boards import TagBoard, picture
from gemelo.libraries.vision.calibration.lens import fit_lens
from gemelo.libraries.vision.calibration.touches import spread_points
from gemelo.libraries.vision.camera_model import model_of
from gemelo.libraries.vision.pages import BAR, POINT, page_of
from gemelo.libraries.vision.rigid import apply, from_transform, inverse, rigid, turn
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.cell import VirtualSource
from gemelo.schemas.joints import JointState
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera
from gemelo.services.camera.virtual.world import CameraWorld
from gemelo.tools.bench.vision import images
from gemelo.tools.bench.vision.images import Surface, render
from gemelo.tools.cli.camera import camera_mount
from gemelo.tools.cli.camera.camera_boards import CHESS_BOARD, TAG_BOARD, tag_board
from gemelo.tools.cli.camera.camera_calibrate import take
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

BOARD_AT = np.array([0.28, -0.02, 0.0])  # [m] of the board with tags on the table
CELL = """
table = 0.0
[[camera]]
name = "overhead"
size = [640, 480]
position = [0.54, 0.0, 0.48]
look_at = [0.27, 0.0, 0.0]
field_of_view = 1.15
[camera.source]
kind = "virtual"
distortion = [0.08, -0.16, 0.0008, -0.0005, 0.02]
"""


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cell with the board with tags on its table."""
    path = tmp_path / "cell.toml"
    path.write_text(CELL + tags_of(TAG_BOARD))
    monkeypatch.setenv("GEMELO_CELL", str(path))
    return path


def tags_of(board: TagBoard) -> str:
    """As a cell has them."""
    return "\n".join(
        f"[[tag]]\nid = {number}\nsize = {board.tag}\nposition = {(BOARD_AT + centre).tolist()}\n"
        for number, centre in board.centres().items()
    )


def squares_of(page: bytes) -> list[tuple[float, float, float, float]]:
    """[m] left, lower edge, width, height of every rectangle of a page."""
    found = re.findall(r"([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re f", page.decode("ascii"))
    return [tuple(float(value) * POINT for value in each) for each in found]  # type: ignore[misc]


@pytest.mark.parametrize("name", ["chess", "tags"])
def test_a_printed_board_is_found_on_its_page_at_its_size(name: str, tmp_path: Path) -> None:
    assert run(["camera", "print", name, "--to", str(tmp_path / "board.pdf")]) is ExitCode.OK
    page = (tmp_path / "board.pdf").read_bytes()
    rectangles = squares_of(page)
    dots = 8000.0  # a metre
    image = np.full((round(0.3 * dots), round(0.3 * dots)), 255, np.uint8)
    for x, y, width, height in rectangles:
        top, bottom = round((0.3 - y - height) * dots), round((0.3 - y) * dots)
        image[top:bottom, round(x * dots) : round((x + width) * dots)] = 0
    board = CHESS_BOARD if name == "chess" else TAG_BOARD
    found = board.find(image)
    assert found is not None
    assert len(found.points) == (35 if name == "chess" else 36)
    span = np.ptp(found.points, axis=0)[:2], np.ptp(found.pixels, axis=0) / dots
    assert span[1] == pytest.approx(span[0], rel=2e-3)
    bars = [width for _, _, width, height in rectangles if height < 0.001 < width]
    assert bars == [pytest.approx(BAR, abs=1e-5)]
    assert page.count(b"endobj") == 5
    begin = int(page.split(b"startxref\n")[1].split(b"\n")[0])
    assert page[begin:].startswith(b"xref")


def test_a_board_that_does_not_fit_the_page_is_refused_with_both_sizes() -> None:
    with pytest.raises(ValueError, match="the board is 300 x 200 mm, and a4 has room for 281 x 174 mm"):
        page_of([], (0.3, 0.2), "", "a4")


def test_a_bar_that_cannot_be_is_refused(cell: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["camera", "calibrate", "--bar", "10mm", "--images", str(tmp_path)]) is ExitCode.USAGE
    assert "the bar of 100 mm was measured as 10 mm" in capsys.readouterr().err


def shots(info_path: Path, arm: ArmDescription, tilt: float, count: int) -> Iterator[GreyImage]:
    """Images of the chess board at random places before the cell's camera."""
    record = load_cell(info_path, arm).camera("overhead")
    model = model_of(exact_info(record, arm.base_frame))
    random = np.random.default_rng(3)
    texture = picture(CHESS_BOARD.squares(), CHESS_BOARD.size, 0.0125, 4000.0).astype(float) * 0.85 + 20.0
    size = tuple(edge + 0.025 for edge in CHESS_BOARD.size)
    for _ in range(count):
        facing = turn(np.array([np.pi, 0.0, 0.0])) @ turn(np.append(random.uniform(-tilt, tilt, 2), 0.0))
        place = np.array([random.uniform(-0.09, 0.09), random.uniform(-0.06, 0.06), random.uniform(0.3, 0.45)])
        yield render(model, [Surface(rigid(facing, place), size, texture)], random)  # type: ignore[arg-type]


def test_tilted_shots_give_the_lens_and_flat_ones_are_refused(
    cell: Path,
    rm1: ArmDescription,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    flat, tilted = tmp_path / "flat", tmp_path / "tilted"
    monkeypatch.setattr(images, "SAMPLES", 3)  # as fine as the noise lets matter
    for folder, tilt, count in ((flat, 0.05, 9), (tilted, 0.6, 14)):
        folder.mkdir()
        for number, image in enumerate(shots(cell, rm1, tilt, count)):
            cv2.imwrite(str(folder / f"{number:02d}.png"), image)
    assert run(["camera", "calibrate", "overhead", "--images", str(flat)]) is ExitCode.FAILED
    assert "the focal length is known to" in capsys.readouterr().err
    assert not cell.with_name(CAMERA_FILE).exists()
    assert run(["camera", "calibrate", "overhead", "--images", str(tilted)]) is ExitCode.OK
    record = load_cell(cell, rm1).camera("overhead")
    exact = exact_info(record, rm1.base_frame)
    found = believed_info(load_cell(cell, rm1), record, rm1.base_frame)
    assert found.intrinsics[0] == pytest.approx(exact.intrinsics[0], rel=5e-3)
    assert found.date
    pixel = np.array([[120.0, 90.0], [520.0, 390.0], [320.0, 240.0]])  # where the shots were
    assert np.abs(model_of(found).rays(pixel) - model_of(exact).rays(pixel)).max() < 4e-3


def test_a_camera_that_streams_is_calibrated_by_shots_that_stand_still_and_differ_until_it_is_enough(
    cell: Path, rm1: ArmDescription, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(images, "SAMPLES", 3)
    taken: list[GreyImage] = []

    def stream() -> Iterator[GreyImage]:
        """Every shot is on its way once, then held still, and once more: one of the three is a new one that stands."""
        for image in shots(cell, rm1, 0.6, 40):
            taken.append(image)
            yield np.roll(image, 6, axis=1)
            yield from (image,) * 3

    kept = take(stream(), CHESS_BOARD, 640, 480, 40)
    assert len(kept) <= len(taken) < 40
    said = capsys.readouterr().out.splitlines()
    assert len(said) == len(kept)
    assert said[-1].endswith("; enough")
    assert not any(line.endswith("; enough") for line in said[:-1])
    assert fit_lens(kept, 640, 480).is_accepted
    seen = [CHESS_BOARD.find(image) for image in taken]
    for sighting in kept:
        assert any(each is not None and np.array_equal(each.pixels, sighting.pixels) for each in seen)


@dataclass
class Hand:
    """An arm whose tip is where a person has led it."""

    tips: Iterator[np.ndarray]
    jaw: float

    def pose(self) -> Pose:
        x, y, z = next(self.tips)
        return Pose((x, y, z + self.jaw), from_rpy(np.pi, 0.0, 0.0))


def touched(
    cell: Path, arm: ArmDescription, board: TagBoard, off: float, monkeypatch: pytest.MonkeyPatch, *options: str
) -> ExitCode:
    """`gemelo camera mount` where a person touches nine points of the board, `off` [m] beside them."""
    known = load_cell(cell, arm)
    record, world = known.camera("overhead"), CameraWorld(arm, known)
    world.on_joint_state(JointState(stamp=1, name=arm.joint_names, position=arm.named_states["folded"]))
    assert isinstance(record.source, VirtualSource)
    exact = exact_info(record, arm.base_frame)
    image = VirtualCamera(record, record.source, exact, world.snapshot).image(world.snapshot())
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    random = np.random.default_rng(1)
    chosen = spread_points(list(board.points()), 9)
    beside = np.array([0.0015, -0.0004, 0.0])  # where the arm's steps end, as the person says for the first
    tips = [BOARD_AT + board.points()[index] + random.normal(0.0, off, 3) for index in chosen]
    tips[0] = tips[0] + beside
    gripper = arm.gripper
    assert gripper is not None
    assert gripper.jaw is not None
    hand = Hand(iter(tips), gripper.jaw[2])

    @contextmanager
    def connected(robot: object) -> Iterator[Hand]:
        yield hand

    for name in ("connect", "connect_arm"):
        monkeypatch.setattr(camera_mount, name, connected)
    monkeypatch.setattr(camera_mount, "from_bus", lambda session, name: iter([grey] * 3))
    monkeypatch.setattr(camera_mount, "step_floor", lambda arm: 0.0016)
    monkeypatch.setattr(camera_mount, "info_of", lambda session, name: exact)
    monkeypatch.setattr("sys.stdin", io.StringIO("1.5mm -0.4mm\n" + "\n" * len(chosen)))
    return run(["camera", "mount", "overhead", *options])


def off_by(cell: Path, arm: ArmDescription) -> float:
    """[m] of points over the table, seen by the camera as it is believed to stand."""
    record = load_cell(cell, arm).camera("overhead")
    found = believed_info(load_cell(cell, arm), record, arm.base_frame)
    assert found.is_mounted
    points = np.array([[0.2, -0.15, 0.0], [0.35, 0.15, 0.0], [0.3, 0.0, 0.05]])
    ours = from_transform(found.parent_from_camera)
    truth = from_transform(exact_info(record, arm.base_frame).parent_from_camera)
    return float(np.linalg.norm(apply(ours, apply(inverse(truth), points)) - points, axis=1).max())


@pytest.mark.parametrize(("off", "code"), [(0.0003, ExitCode.OK), (0.02, ExitCode.FAILED)])
def test_touched_tags_tell_where_the_camera_stands_and_bad_ones_write_nothing(
    cell: Path,
    rm1: ArmDescription,
    off: float,
    code: ExitCode,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    outer = ["the upper left corner of tag 200", "the lower right corner of tag 208"]
    outer += ["the upper right corner of tag 202", "the lower left corner of tag 206"]
    assert touched(cell, rm1, TAG_BOARD, off, monkeypatch) is code
    said = capsys.readouterr()
    assert re.findall(r"the tip onto (.*) \(", said.out)[:4] == outer
    assert said.out.count("the arm's steps end up to 1.6 mm beside") == 9 - 1
    if code is not ExitCode.OK:
        assert "nothing was written" in said.err
        assert not cell.with_name(CAMERA_FILE).exists()
        return
    assert off_by(cell, rm1) < 1.5e-3


@pytest.mark.parametrize("bar", ["108mm", "100mm"])
def test_a_board_that_was_printed_too_large_is_measured_by_its_bar(
    cell: Path, rm1: ArmDescription, bar: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    printed = tag_board("108mm")
    cell.write_text(CELL + tags_of(printed))
    code = touched(cell, rm1, printed, 0.0003, monkeypatch, "--bar", bar)
    is_good = code is ExitCode.OK and off_by(cell, rm1) < 1.5e-3
    assert is_good == (bar == "108mm")


def test_with_nobody_at_the_keyboard_nothing_is_measured(
    cell: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def connected(robot: object) -> Iterator[None]:
        yield None

    monkeypatch.setattr(camera_mount, "connect_arm", connected)
    monkeypatch.setattr("sys.stdin", io.StringIO(""))
    assert run(["camera", "mount", "overhead"]) is ExitCode.FAILED
    assert "nobody to look" in capsys.readouterr().err
    assert run(["camera", "mount", "overhead", "--points", "3"]) is ExitCode.USAGE
    assert run(["camera", "mount", "elsewhere"]) is ExitCode.USAGE
