"""`gemelo camera check`: it points, asks, and says where an error comes from."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from gemelo import Pose, Seen
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.tools.cli.camera import camera_check
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

ROOT = Path(__file__).parents[2]


class Scene:
    def __init__(self) -> None:
        self.objects = {"post": None}

    def remove(self, name: str) -> None:
        del self.objects[name]


class Pointer:
    """An arm that goes where it is told, and remembers."""

    def __init__(self, description: ArmDescription, seen: tuple[Seen, ...]) -> None:
        self.description, self.seen = description, seen
        self.joint_names = description.joint_names
        self.joints = dict.fromkeys(self.joint_names, 0.1)
        self.scene, self.went = Scene(), []

    def detect(self, camera: str, scene: bool) -> tuple[Seen, ...]:
        assert scene
        self.scene.objects |= dict.fromkeys(each.name for each in self.seen)
        return self.seen

    def move(self, position: tuple[float, float, float]) -> None:
        self.went.append(position)

    def fk(self, joints: dict[str, float]) -> SimpleNamespace:
        values = np.array([joints[name] for name in self.joint_names])
        return SimpleNamespace(position=(0.3 * np.cos(values[0]), 0.3 * np.sin(values[0]), values[2]))


def tag(name: str, x: float, y: float, trouble: str = "") -> Seen:
    return Seen(name, Pose((x, y, 0.04)), 0.0001, "tag", "overhead", 0, trouble)


SEEN = (tag("cup", 0.26, 0.16), tag("tray", 0.14, -0.32), tag("lid", 0.4, 0.0), tag("far", 0.9, 0.0, "it flips"))


@pytest.fixture
def pointer(monkeypatch) -> Iterator[Pointer]:
    monkeypatch.setenv("GEMELO_CELL", str(ROOT / "urdf/rm1/cell.toml"))
    made = Pointer(load_arm(ROOT / "urdf/rm1"), SEEN)

    @contextmanager
    def connected(robot: object) -> Iterator[Pointer]:
        yield made

    monkeypatch.setattr(camera_check, "connect_arm", connected)
    return made


def answer(monkeypatch, *lines: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("".join(f"{line}\n" for line in lines)))


def test_it_points_above_each_tag_with_the_tip_and_finds_nothing_wrong(pointer, monkeypatch, capsys):
    answer(monkeypatch, "", "0.2mm -0.1mm", "")
    assert run(["camera", "check", "overhead", "--above", "12mm"]) is ExitCode.OK
    jaw = pointer.description.gripper.jaw[2]
    assert pointer.went == [pytest.approx((*each.pose.position[:2], 0.04 + 0.012 + jaw)) for each in SEEN[:3]]
    out = capsys.readouterr().out
    assert "tray: +0.2 -0.1 mm, step floor" in out
    assert "mount never measured" in out
    assert "no more than camera, mount and arm are good for" in out
    assert list(pointer.scene.objects) == ["post"]  # what it put there to keep away from is gone


def test_a_camera_that_was_pushed_is_named_with_the_remedy(pointer, monkeypatch, capsys):
    answer(monkeypatch, "6mm 2mm", "6.1mm 1.9mm", "six", "5.9mm 2mm")
    assert run(["camera", "check"]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "two lengths are wanted" in said
    assert "the camera stands elsewhere: `gemelo camera mount`" in said


@pytest.mark.parametrize(
    ("words", "sentence", "code"),
    [
        (["--above", "2mm"], "a tip that near may touch", ExitCode.USAGE),
        (["elsewhere"], "elsewhere", ExitCode.USAGE),
        ([], "there is nobody to look", ExitCode.FAILED),
    ],
)
def test_what_cannot_be_is_said(pointer, monkeypatch, capsys, words, sentence, code):
    answer(monkeypatch)
    assert run(["camera", "check", *words]) is code
    assert sentence in capsys.readouterr().err
    assert list(pointer.scene.objects) == ["post"]


def test_no_tag_that_can_be_located_is_said_with_its_trouble(pointer, monkeypatch, capsys):
    pointer.seen = SEEN[3:]
    answer(monkeypatch)
    assert run(["camera", "check"]) is ExitCode.FAILED
    assert "sees no tag of the cell file that it can locate: far: it flips" in capsys.readouterr().err
