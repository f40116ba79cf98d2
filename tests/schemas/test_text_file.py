"""Text files as editors on other systems save them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import gemelo
from gemelo.api.scene_files import read_scene, write_scene
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.robot_import.questions import read_answers
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.errors import RequestRefused
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.programs import Points
from gemelo.programs.reading import read_program
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.text_file import NotUtf8, decode_text
from gemelo.services.state_publisher.main import describe
from gemelo.tools.cli.motion.plan_file import read_plan
from gemelo.tools.hosts.site_file import read_site

ROOT = Path(__file__).parents[2]
MARK = b"\xef\xbb\xbf"


def robot(folder: Path, file: str) -> Path:
    """A copy of rm1, and the file of it."""
    shutil.copytree(ROOT / "urdf" / "rm1", folder / "rm1")
    return folder / "rm1" / file


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def scene(folder: Path) -> Path:
    write_scene(PlanningScene(), folder / "scene.json")
    return folder / "scene.json"


# How a file of each kind is made, and how it is read.
KINDS: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object]]] = {
    "robot.toml": (lambda at: robot(at, "robot.toml"), lambda path: load_arm(path.parent)),
    "robot.srdf": (lambda at: robot(at, "robot.srdf"), lambda path: load_arm(path.parent)),
    "robot.urdf": (lambda at: robot(at, "robot.urdf"), lambda path: load_arm(path.parent)),
    "cell.toml": (lambda at: robot(at, "cell.toml"), lambda path: load_cell(path, load_arm(path.parent))),
    "a program": (lambda at: written(at / "a.toml", (ROOT / "programs" / "tour.toml").read_text()), read_program),
    "points": (
        lambda at: written(at / "rm1.points.toml", (ROOT / "programs" / "rm1.points.toml").read_text()),
        lambda path: dict(Points.load(path.parent, load_arm(ROOT / "urdf" / "rm1"))),
    ),
    "a deployment": (lambda at: written(at / "d.toml", 'robot = "urdf/rm1"\n'), lambda path: load_deployment(path, {})),
    "a site": (
        lambda at: written(at / "s.toml", (ROOT / "deploy/hosts/example.toml").read_text()),
        lambda path: read_site(path)[0],
    ),
    "saved parameters": (
        lambda at: written(at / "parameters" / "planner.toml", "margin = 0.01\n"),
        lambda path: SavedParameters(path.parents[1], "planner").read(),
    ),
    "answers": (lambda at: written(at / "answers.toml", 'name = "a"\n'), read_answers),
    "a scene": (scene, read_scene),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_byte_order_mark_is_skipped_and_utf_16_is_refused_by_name(tmp_path: Path, kind: str) -> None:
    make, read = KINDS[kind]
    path = make(tmp_path)
    plain = read(path)
    content = path.read_bytes()
    path.write_bytes(MARK + content.replace(b"\n", b"\r\n"))
    marked = read(path)
    assert repr(marked) == repr(plain)
    for encoding in ("utf-16", "utf-32"):
        path.write_bytes((content.decode() or "#").encode(encoding))
        with pytest.raises((ValueError, gemelo.Error, RequestRefused), match="save it as UTF-8"):
            read(path)


def test_the_arms_files_are_published_without_a_mark(tmp_path: Path) -> None:
    for name in ("robot.toml", "robot.srdf", "robot.urdf"):
        path = tmp_path / "rm1" / name if (tmp_path / "rm1").exists() else robot(tmp_path, name)
        path.write_bytes(MARK + path.read_bytes())
    assert describe(load_arm(tmp_path / "rm1")) == describe(load_arm(ROOT / "urdf" / "rm1"))


def test_a_plan_that_another_shell_wrote_is_refused_by_its_encoding(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("{}", encoding="utf-16")
    with pytest.raises(Exception, match="this is UTF-16: save it as UTF-8"):
        read_plan(str(path), load_arm(ROOT / "urdf" / "rm1"))
    with pytest.raises(gemelo.Error, match="this is UTF-16: save it as UTF-8"):
        gemelo.Plan.load(str(path))


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        (b"\xff\xfea\0", "this is UTF-16"),
        (b"\xfe\xff\0a", "this is UTF-16"),
        (b"a\0b\0", "UTF-16 without its mark"),
        (b"a = 1\nb = '\xf1'\n", "line 2: the byte 0xf1 is not UTF-8"),
    ],
)
def test_what_is_not_utf_8_is_said_with_its_place(raw: bytes, reason: str) -> None:
    with pytest.raises(NotUtf8, match=reason):
        decode_text(raw)
