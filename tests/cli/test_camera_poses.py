"""`gemelo camera mount` by itself: poses are shown and agreed to, driven, looked from, and believed or refused."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import pytest

import gemelo
from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE, MOUNT_BOARD
from gemelo.libraries.arm.cell.camera_model import believed_info
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.vision.rigid import from_transform, step, to_transform
from gemelo.libraries.vision.tags import GreyImage
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import TagRecord
from gemelo.tools.bench.vision.mount_images import (
    OFF,
    Setup,
    Sight,
    board_on_tool,
    camera_on_link,
    limits_of,
    standing,
    tag_on_level_tool,
)
from gemelo.tools.bench.vision.mounting import tool_error
from gemelo.tools.cli.camera import camera_poses
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.session import reported
from gemelo.tools.cli.main import run

ROOT = Path(__file__).parents[2]


@dataclass
class Shown:
    """An arm that stands where it was sent, and its camera."""

    sight: Sight
    description: ArmDescription
    start: tuple[float, ...]
    went: list[tuple[float, ...]] = field(default_factory=list)
    hidden: set[int] = field(default_factory=set)  # of its motions: after these nothing is seen
    refused: set[int] = field(default_factory=set)
    interrupted: int = 0  # of its motions: the one that a person stops with Ctrl-C
    carried: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.joint_names, self.base_frame = self.description.joint_names, self.description.base_frame
        self.joints = dict(zip(self.joint_names, self.start, strict=True))
        self.scene, self._may_stand = self, standing(self.description)

    def check(self, joints: dict[str, float]) -> None:
        if not self._may_stand(np.array([joints[name] for name in self.joint_names])):
            raise gemelo.Refused("refused: the links touch", reason="the links touch")

    def move(self, joints: dict[str, float], speed: float) -> None:
        assert 0.0 < speed <= 1.0
        self.went.append(tuple(joints.values()))
        if len(self.went) == self.interrupted:
            raise gemelo.Interrupted("the arm rests")
        if len(self.went) in self.refused:
            raise gemelo.Refused("refused: post is in the way")
        self.joints = dict(joints)

    def add_box(
        self, name: str, size: tuple[float, ...], *, frame: str, attach: bool, touch: list[str], **_: object
    ) -> None:
        assert attach
        assert frame in touch
        self.carried.append(name)

    def remove(self, name: str) -> None:
        self.carried.remove(name)

    @property
    def info(self) -> CameraInfo:
        """What is believed at first is off by 30 mm and 5 degrees."""
        pose = to_transform(self.sight.truth @ step(OFF))
        return msgspec.structs.replace(self.sight.info, parent_from_camera=pose)

    def images(self, count: int) -> list[GreyImage]:
        image = self.sight.image(np.array(list(self.joints.values())))
        return [np.zeros_like(image) if len(self.went) in self.hidden else image] * count


def written(setup: Setup, folder: Path, tags: tuple[TagRecord, ...] = ()) -> Path:
    """The cell file of the camera and of `tags`."""
    camera, source = setup.camera, setup.camera.source
    lines = ["table = 0.0", "[[camera]]", f'name = "{camera.name}"', f'parent = "{camera.parent}"']
    lines += [f"{key} = {list(getattr(camera, key))}" for key in ("size", "position", "look_at")]
    lines += [f"field_of_view = {camera.field_of_view}", "[camera.source]", 'kind = "virtual"']
    lines += [f"distortion = {list(source.distortion)}"]
    for tag in tags:
        lines += ["[[tag]]", f"id = {tag.id}", f"size = {tag.size}", f'parent = "{tag.parent}"']
        lines += [f"position = {list(tag.position)}", f"rpy = {list(tag.rpy)}"]
    path = folder / "cell.toml"
    path.write_text("\n".join(lines))
    return path


@pytest.fixture
def show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """Makes the deployment's robot and cell those of a setup, and gives the arm that the command then connects to."""

    def start(setup: Setup, tags: tuple[TagRecord, ...] = ()) -> tuple[Shown, Path]:
        source = msgspec.structs.replace(setup.camera.source, samples=1)
        setup = Setup(**{**vars(setup), "camera": msgspec.structs.replace(setup.camera, source=source)})
        path = written(setup, tmp_path, tags)
        monkeypatch.setenv("GEMELO_ROBOT", str(setup.arm.folder))
        monkeypatch.setenv("GEMELO_CELL", str(path))
        shown = Shown(Sight(setup), setup.arm, setup.start)

        @contextmanager
        def connected(robot: gemelo.Robot) -> Iterator[Shown]:
            with reported(robot):
                yield shown

        monkeypatch.setattr(camera_poses, "connect_arm", connected)
        monkeypatch.setattr(camera_poses, "Eye", lambda arm, name: shown)
        return shown, path

    return start


def parol6() -> ArmDescription:
    return load_arm(ROOT / "urdf/parol6")


def rm1() -> ArmDescription:
    return load_arm(ROOT / "urdf/rm1")


def off(shown: Shown, path: Path) -> float:
    """[mm] of what camera.toml says now."""
    setup = shown.sight.setup
    cell = load_cell(path, setup.arm)
    found = believed_info(cell, cell.cameras[0], setup.arm.base_frame)
    assert found.date
    assert found.parent == shown.sight.info.parent
    return tool_error(from_transform(found.parent_from_camera), shown.sight.truth, setup.carrier)


def test_a_camera_on_a_link_is_placed_and_poses_that_show_nothing_are_named(show, capsys):
    shown, path = show(camera_on_link(parol6()))
    shown.hidden, shown.refused = {2, 4, 6, 8}, {5}
    assert run(["camera", "mount", "wrist", "--poses", "12", "--yes"]) is ExitCode.OK
    said = capsys.readouterr().out
    for number in (2, 4, 6, 8):
        assert f"pose {number} is left out: 0 tags are seen, at least 4 are needed" in said
    assert "pose 5 is left out: refused: post is in the way" in said
    assert "pose 7: 9 tags" in said
    assert "mm in link_6" in said
    assert len(shown.went) == 13
    assert shown.went[-1] == shown.start  # and back
    assert off(shown, path) < 0.5


def test_too_few_poses_that_show_the_board_write_nothing(show, capsys):
    shown, path = show(camera_on_link(parol6()))
    shown.hidden = set(range(4, 20))
    assert run(["camera", "mount", "wrist", "--poses", "8", "--yes"]) is ExitCode.FAILED
    assert "4 poses show the board, at least 5 are needed; nothing was written" in capsys.readouterr().err
    assert not path.with_name(CAMERA_FILE).exists()


def test_a_board_on_the_tool_places_a_camera_that_stands_and_is_a_part_of_the_arm_meanwhile(show, capsys, monkeypatch):
    shown, path = show(board_on_tool(parol6()))
    carried = []
    monkeypatch.setattr(camera_poses, "drive", lambda *arguments: (carried.extend(shown.carried), drive(*arguments))[1])
    assert run(["camera", "mount", "side", "--on", "tool_link", "--poses", "9", "--yes"]) is ExitCode.OK
    assert carried == [MOUNT_BOARD]
    assert shown.carried == []
    assert "mm in base_link" in capsys.readouterr().out
    assert off(shown, path) < 0.5


drive = camera_poses.drive


def test_a_tag_that_is_larger_than_said_is_refused_by_name(show, capsys):
    shown, path = show(board_on_tool(parol6()))
    assert run(["camera", "mount", "--on", "tool_link", "--poses", "9", "--bar", "95mm", "--yes"]) is ExitCode.FAILED
    assert "% larger than is said of them" in capsys.readouterr().err
    assert not path.with_name(CAMERA_FILE).exists()
    assert shown.carried == []


def tag_of(setup: Setup, height: float) -> TagRecord:
    """The tag on the tool as a person has it, who knows its height at most."""
    return TagRecord(id=200 + 50, size=0.05, parent=setup.link, position=(0.0, 0.0, height))


@pytest.mark.parametrize(
    ("words", "in_cell", "code"),
    [([], 0.0, ExitCode.FAILED), (["--tag-height", "-30mm"], 0.0, ExitCode.OK), ([], -0.03, ExitCode.OK)],
)
def test_an_arm_that_cannot_tilt_needs_the_height_of_its_tag(show, capsys, words, in_cell, code):
    setup = tag_on_level_tool(rm1())
    tags = tuple(msgspec.structs.replace(tag, id=250) for tag in setup.tags)
    board = type(setup.board)(columns=1, rows=1, tag=0.05, first=250)
    setup = Setup(**{**vars(setup), "tags": tags, "board": board})
    shown, path = show(setup, (tag_of(setup, in_cell),))
    assert run(["camera", "mount", "overhead", "--on", "efector_link", "--yes", *words]) is code
    said = capsys.readouterr()
    if code is ExitCode.FAILED:
        assert "the camera's height and the board's height on the link cannot be told apart" in said.err
        assert "--tag-height; nothing has moved" in said.err
        assert shown.went == []
        assert not path.with_name(CAMERA_FILE).exists()
        return
    assert ("taken as -30.0 mm, as cell.toml says" in said.out) is bool(in_cell)
    assert off(shown, path) < 0.5


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--poses", "4"], "--poses 4 is not 5 to 60"),
        (["--on", "tool_link"], "rides on link_6: lay the board down, without --on"),
    ],
)
def test_what_cannot_be_asked_is_said(show, capsys, words, sentence):
    show(camera_on_link(parol6()))
    assert run(["camera", "mount", "wrist", "--yes", *words]) is ExitCode.USAGE
    assert sentence in capsys.readouterr().err


def test_nothing_moves_before_a_person_agrees_or_without_a_first_sight_of_the_tags(show, capsys):
    shown, _ = show(camera_on_link(parol6()))
    assert run(["camera", "mount", "wrist", "--poses", "6"]) is ExitCode.USAGE
    said = capsys.readouterr()
    assert "  6: joint_1 " in said.out
    assert "There is nobody to ask: say --yes" in said.err
    shown.hidden = {0}
    assert run(["camera", "mount", "wrist", "--yes"]) is ExitCode.FAILED
    assert (
        "0 tags are seen, at least 4 are needed where the arm stands now: bring it to where" in capsys.readouterr().err
    )
    assert shown.went == []


def test_the_poses_keep_to_the_joints_limits(show):
    shown, _ = show(board_on_tool(parol6()))
    assert run(["camera", "mount", "side", "--on", "tool_link", "--poses", "6", "--yes"]) is ExitCode.OK
    lower, upper = limits_of(shown.description)
    assert all((np.array(each) >= lower).all() and (np.array(each) <= upper).all() for each in shown.went)


def test_a_link_that_is_none_is_named_with_the_nearest(show, capsys):
    show(board_on_tool(parol6()))
    assert run(["camera", "mount", "side", "--on", "tool_lnk", "--yes"]) is ExitCode.USAGE
    assert "tool_link" in capsys.readouterr().err


def test_ctrl_c_ends_it_where_the_arm_rests_and_takes_the_board_out_of_the_plans(show, capsys):
    shown, path = show(board_on_tool(parol6()))
    shown.interrupted = 3
    assert run(["camera", "mount", "side", "--on", "tool_link", "--poses", "6", "--yes"]) is ExitCode.CANCELLED
    assert "the arm rests" in capsys.readouterr().err
    assert len(shown.went) == 3
    assert shown.carried == []
    assert not path.with_name(CAMERA_FILE).exists()
