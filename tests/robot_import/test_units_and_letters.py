"""Sizes, limits and letters of exports: COLLADA's units, limits in degrees or turned about, encodings by name."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import trimesh

from gemelo.libraries.arm.checks import meshes
from gemelo.libraries.arm.checks.meshes import MeshFacts, facts_of
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.urdf import Limit
from gemelo.libraries.robot_import.limits import ask_limits
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.mesh_copies import copy_meshes
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from tests.robot_import.exports import joint, link, write

TREE = '<link name="Eslabón"/><link name="arm"/>'


def collada(path: Path, length: float, metres: str) -> Path:
    """A box of `length` in units of `metres`."""
    trimesh.creation.box((length, 0.3 * length, 0.2 * length)).export(path)
    unit = f'<unit name="some" meter="{metres}"/>'
    path.write_text(path.read_text().replace("<up_axis>", f"{unit}<up_axis>"))
    return path


@pytest.mark.parametrize("metres", ["0.01", "0.0254", "1e-3", "1"])
def test_a_collada_file_has_the_size_that_its_unit_says(tmp_path: Path, metres: str):
    collada(tmp_path / "arm.dae", 0.2 / float(metres), metres)
    known = facts_of(tmp_path / "arm.dae")
    assert isinstance(known, MeshFacts)
    assert known.longest == pytest.approx(0.2)
    found = mend(find_source(write(tmp_path / "robot.urdf", "robot", link("arm", "arm.dae"))))
    assert not [each for each in found.findings() if "millimetres" in str(each)]
    (tmp_path / "copy").mkdir()
    copy_meshes(found, tmp_path / "copy")
    (copied,) = (tmp_path / "copy" / "meshes").iterdir()
    assert max(trimesh.load_scene(copied).extents) == pytest.approx(0.2)


def completed(tmp_path: Path, limit: str, kind: str = "revolute") -> Limit:
    """The limits of a joint as an import with every default leaves them."""
    text = f'<limit effort="1" {limit}/>'
    file = write(tmp_path / "robot.urdf", "robot", TREE, joint("one", "Eslabón", "arm", kind=kind, rest=text))
    found = mend(find_source(file))
    ask_limits(found, Questions({}, takes_defaults=True))
    assert not [each for each in found.findings() if str(each).startswith("error")]
    limits = found.model.joint("one").limit
    assert limits is not None
    return limits


LIMITS = {
    "degrees": ('lower="-90" upper="45" velocity="180"', "revolute", (-math.pi / 2, math.pi / 4, math.pi)),
    "turned about": ('lower="1" upper="-2" velocity="2"', "revolute", (-2.0, 1.0, 2.0)),
    "millimetres": ('lower="0" upper="300" velocity="150"', "prismatic", (0.0, 0.3, 0.15)),
    "no end": ('lower="-inf" upper="inf" velocity="inf"', "revolute", (-math.pi, math.pi, 1.0)),
    "no number that stands for no end": ('lower="-999999" upper="999999" velocity="1"', "prismatic", (0.0, 0.2, 1.0)),
}


@pytest.mark.parametrize(("limit", "kind", "expected"), LIMITS.values(), ids=list(LIMITS))
def test_limits_without_sense_become_what_they_were_meant_to_be(
    tmp_path: Path, limit: str, kind: str, expected: tuple[float, float, float]
):
    found = completed(tmp_path, limit, kind)
    assert (found.lower, found.upper, found.velocity) == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("encoding", ["iso-8859-1", "utf-16", "utf-8-sig", "cp1252"])
def test_the_letters_are_read_as_the_first_line_says(tmp_path: Path, encoding: str):
    path = tmp_path / "robot.urdf"
    named = encoding.removesuffix("-sig")
    path.write_bytes(f'<?xml version="1.0" encoding="{named}"?>\n<robot name="a">{TREE}</robot>'.encode(encoding))
    assert find_source(path).text.count("Eslabón") == 1
    assert [each.name for each in mend(find_source(path)).model.links] == ["Eslabon", "arm"]


def test_letters_that_no_line_names_are_refused_with_what_would_do(tmp_path: Path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(f'<robot name="a">{TREE}</robot>'.encode("iso-8859-1"))
    with pytest.raises(DescriptionError, match=r"its letters are not utf-8.*: save it as UTF-8"):
        find_source(path)


def test_blank_lines_before_the_first_are_no_fault_and_count(tmp_path: Path):
    path = tmp_path / "robot.urdf"
    path.write_text(f'\n\n<?xml version="1.0"?>\n<robot name="a">{TREE}</robot>')
    (said,) = (str(each) for each in mend(find_source(path)).findings() if "blanks" in str(each))
    assert "robot.urdf, line 4" in said


def test_a_copy_of_a_mesh_is_not_read_again_and_a_changed_one_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    body = trimesh.creation.box((0.1, 0.2, 0.31))
    for name in ("one.stl", "copy.STL"):
        (tmp_path / name).write_bytes(trimesh.exchange.stl.export_stl(body))
    known = facts_of(tmp_path / "one.stl")
    with monkeypatch.context() as patched:
        patched.setattr(meshes, "scene_of", None)  # what would be read now would be an error
        assert facts_of(tmp_path / "copy.STL") == known
    body.apply_scale(2.0)
    (tmp_path / "one.stl").write_bytes(trimesh.exchange.stl.export_stl(body))
    changed = facts_of(tmp_path / "one.stl")
    assert isinstance(changed, MeshFacts)
    assert changed.longest == pytest.approx(0.62)
