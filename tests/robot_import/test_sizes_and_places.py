"""Meshes of the wrong size or in the wrong place: one answer is mended, with none or two a person is asked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from tests.robot_import.plain_arm import APART, arm, body, boxes, hinges, meshed, stl
from tests.table import table

UNITS = {"m": 1.0, "mm": 0.001, "cm": 0.01, "in": 0.0254}  # [m]


def looked_at(file: Path, **given: str) -> Mended:
    return mend(find_source(file), Questions(given, takes_defaults=True))


def errors_of(found: Mended) -> list[str]:
    return [str(each) for each in found.findings() if each.severity is Severity.ERROR]


def in_unit(folder: Path, unit: str, length: float, apart: float = APART, scale: str = "") -> Path:
    """An arm whose links are one mesh of `length` [m], in a unit that nothing names."""
    metres = UNITS[unit]
    stl(folder / "u.stl", (0.05 / metres, 0.05 / metres, length / metres))
    content = meshed("u.stl", scale)
    return arm(folder, boxes(**dict.fromkeys(("base", "upper", "fore", "hand"), content)), hinges(apart))


@table("unit", ["m", "mm", "cm", "in"])
@table("apart", [0.05, 0.2, 0.9])
def test_meshes_get_the_unit_in_which_they_reach_from_joint_to_joint(tmp_path: Path, unit: str, apart: float):
    for share in (1.0, 1.2):
        found = looked_at(in_unit(tmp_path / f"{unit}{apart}{share}", unit, share * apart, apart))
        assert errors_of(found) == []
        scales = {shape.scale[0] for link in found.model.links for shape in (*link.visuals, *link.collisions)}
        assert scales == {UNITS[unit]}
        said = [each for each in found.notes if "it is in" in each.message]
        assert len(said) == (0 if unit == "m" else 2)  # once for what is seen, once for what is touched
        assert all(each.line == 3 and "as 4 <" in each.message for each in said)


@pytest.mark.parametrize("scale", ["0.001 0.001 0.001", "1 1 1"])
def test_a_scale_that_is_written_and_wrong_is_written_anew(tmp_path: Path, scale: str):
    found = looked_at(in_unit(tmp_path, "cm", 0.22, scale=scale))
    assert errors_of(found) == []
    assert {link.visuals[0].scale for link in found.model.links} == {(0.01, 0.01, 0.01)}


def test_where_two_units_fit_a_person_is_asked_and_nobody_guesses(tmp_path: Path):
    file = in_unit(tmp_path, "cm", 0.7 * APART)  # 14 units: 0.14 m in centimetres, 0.36 m in inches
    said = errors_of(looked_at(file))
    assert len(said) == 2
    assert re.search(
        r'line 3: link "base": mesh "u.stl" is 14 m long.*(centimetres and inches|inches and centimetres) fit', said[0]
    )
    assert 'visual_mesh_unit = "m" (m, mm, cm, in, as_written) into a file for `gemelo import --answers`' in said[0]
    for unit in ("cm", "in", "as_written"):
        found = looked_at(file, visual_mesh_unit=unit, collision_mesh_unit=unit)
        assert {link.visuals[0].scale[0] for link in found.model.links} == {UNITS.get(unit, 1.0)}


def test_where_no_unit_fits_a_person_is_asked(tmp_path: Path):
    assert "no unit fits" in errors_of(looked_at(in_unit(tmp_path, "m", 2000.0)))[0]


def test_a_fat_or_a_thin_link_is_no_other_unit(tmp_path: Path):
    for share in (0.5, 3.0):
        found = looked_at(in_unit(tmp_path / f"{share}", "m", share * APART))
        assert [each.message for each in found.findings()] == []


def test_one_mesh_in_another_unit_among_others_is_mended_alone(tmp_path: Path):
    stl(tmp_path / "good.stl")
    stl(tmp_path / "mm.stl", (50.0, 50.0, 200.0))
    contents = {name: meshed("good.stl") for name in ("base", "fore", "hand")}
    found = looked_at(arm(tmp_path, boxes(upper=meshed("mm.stl"), **contents), hinges()))
    assert errors_of(found) == []
    assert [link.visuals[0].scale[0] for link in found.model.links] == [1.0, 0.001, 1.0, 1.0]


def assembled(folder: Path, aside: float = 0.0) -> Path:
    """Each link a mesh file of its own, in the frame of the assembly, moved by `aside` [m]."""
    contents = {}
    for number, name in enumerate(("base", "upper", "fore", "hand")):
        stl(folder / f"{name}.stl", at=(aside, 0.0, number * APART))
        contents[name] = meshed(f"{name}.stl")
    return arm(folder, boxes(**contents), hinges())


def test_meshes_in_the_frame_of_the_assembly_are_put_where_their_links_are(tmp_path: Path):
    found = looked_at(assembled(tmp_path))
    assert errors_of(found) == []
    for number, link in enumerate(found.model.links):
        for shape in (*link.visuals, *link.collisions):
            assert shape.origin.xyz == pytest.approx((0.0, 0.0, -number * APART))
    said = [each for each in found.notes if "frame of the assembly" in each.message]
    assert [each.line for each in said] == [4, 5, 6]
    assert said[2].remedy == '<origin xyz="0 0 -0.6" rpy="0 0 0"/>'


def test_meshes_beside_their_joints_that_no_frame_explains_are_asked_for(tmp_path: Path):
    file = assembled(tmp_path, aside=0.85)
    said = errors_of(looked_at(file))
    assert len(said) == 4
    assert 'line 3: link "base": its mesh lies 825 mm from its joints' in said[0]
    kept = looked_at(file, mesh_places="as_written")
    assert errors_of(kept) == []
    assert {each.severity for each in kept.notes if "lies" in each.message} == {Severity.WARNING}


def test_a_collision_shape_beside_what_it_is_of_is_put_there_or_asked_for(tmp_path: Path):
    beside = body("visual") + body("collision", xyz="0.5 0 0.1")
    same = looked_at(arm(tmp_path / "same", boxes(fore=beside), hinges()))
    assert errors_of(same) == []
    assert same.model.links[2].collisions[0].origin.xyz == (0.0, 0.0, 0.1)
    assert "stands 450 mm beside its <visual>, of the same size" in same.notes[0].message
    ball = '<geometry><sphere radius="0.04"/></geometry>'
    other = arm(tmp_path / "other", boxes(fore=body("visual") + body("collision", ball, "0.5 0 0.1")), hinges())
    (said,) = errors_of(looked_at(other))
    assert 'line 5: link "fore": its <collision> stands 435 mm beside its <visual>' in said
    assert errors_of(looked_at(other, collision_places="as_written")) == []


@pytest.mark.parametrize(
    ("place", "why", "there"),
    [
        ("0 0 0.5", "it is in the frame of the assembly", (0.0, 0.0, 0.1)),
        ("0 0 100", "it is in millimetres", (0.0, 0.0, 0.1)),
        ("0.7 0.2 0", "and is put into its middle", (0.0, 0.0, 0.1)),
    ],
)
def test_a_centre_of_mass_far_outside_its_link_is_put_into_it(
    tmp_path: Path, place: str, why: str, there: tuple[float, ...]
):
    inertia = '<mass value="0.5"/><inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/>'
    mass = f'<inertial><origin xyz="{place}"/>{inertia}</inertial>'
    found = looked_at(arm(tmp_path, boxes(fore=mass + body("visual") + body("collision")), hinges()))
    assert errors_of(found) == []
    assert found.model.links[2].inertial is not None
    assert found.model.links[2].inertial.origin.xyz == pytest.approx(there)
    assert [each.line for each in found.notes if why in each.message] == [5]
