"""The collision model is the owner's, `home` is as near to zero as can be, and what is large becomes small enough."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.checks.meshes import MOST_TRIANGLES
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.srdf_edit import entries
from gemelo.libraries.robot_import.mesh_copies import MOST_COARSER, coarser
from gemelo.libraries.robot_import.survey import MOST_PARTS
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanRequest, PoseGoal
from gemelo.services.planner.core import Planner
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.plain_arm import LIMIT, arm, body, boxes, hinge, hinges, meshed, part, stl
from tests.robot_import.test_what_restricts_motion import jaws, survey


def imported(source: Path, output: Path, *words: str, code: ExitCode = ExitCode.OK) -> Path:
    assert run(["import", str(source), "--yes", "--output", str(output), *words]) is code
    return output / "arm"


def test_the_owners_collision_shapes_are_kept_and_what_they_lack_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    """Own meshes are fitted to, a link without any gets none, and a missing picture is no reason to refuse."""
    folder = tmp_path / "in"
    stl(folder / "thin.stl")
    stl(folder / "thick.stl", (0.08, 0.08, 0.2))
    stl(folder / "hand.stl")
    source = arm(
        folder,
        boxes(
            base=meshed("thin.stl", tags=("visual",)) + meshed("thick.stl", tags=("collision",)),
            upper=body("visual"),
            fore=meshed("gone.stl", tags=("visual",)) + body("collision"),
            hand=meshed("hand.dae"),
        ),
        hinges(),
    )
    loaded = load_arm(imported(source, tmp_path / "urdf"))
    said = capsys.readouterr().out
    links = {link.name: link for link in loaded.model.links}
    (shape,) = links["base"].collisions
    assert sorted(shape.size) == pytest.approx([0.08, 0.08, 0.2], abs=1e-3)
    assert links["upper"].collisions == ()
    assert [each.shape for each in links["fore"].visuals] == ["box"]
    for words in (
        'arm.urdf, line 3: link "base": 1 links have <collision> meshes of their own -> collision shapes are fitted',
        'arm.urdf, line 4: link "upper": can be seen but not touched: it has no <collision> -> nothing will touch it',
        'arm.urdf, line 5: link "fore": mesh "gone.stl" is not there -> left out: it is drawn with its <collision>',
        'arm.urdf, line 6: link "hand": mesh "hand.dae" is not there, but hand.stl is -> filename="hand.stl"',
    ):
        assert words in said, said
    assert said.count("can be seen but not touched") == 1
    wanted = survey(source, shapes_for_drawn="yes")
    assert wanted.description is not None
    assert wanted.description.mended.fits_bare


@pytest.mark.parametrize("name", ["base_link.dae", "meshes/base_link.dae", "package://arm/base_link.dae"])
def test_a_hint_names_the_file_that_differs_in_its_ending_alone(tmp_path: Path, name: str):
    for file in ("a/base_link.stl", "b/base_link.stl", "a/estop_link.dae"):
        stl(tmp_path / file)
    found = survey(arm(tmp_path, boxes(base=meshed(name)), hinges()))
    (said,) = (str(each) for each in found.findings if each.severity is Severity.ERROR)
    assert f'mesh "{name}" is not there, and 2 have that name: a/base_link.stl, b/base_link.stl ->' in said


def sliding(folder: Path, low: float, high: float) -> Path:
    """A tip that is `low` to `high` [m] apart from the base and no neighbour of it."""
    block = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
    ball = '<geometry><sphere radius="0.002"/></geometry>'
    slide = f'<limit lower="0" upper="{high - low}" effort="9" velocity="1"/>'
    contents = {"base": ("0 0 0.05", block), "turn": ("0.3 0 0", ball), "tip": ("0 0 0.05", block)}
    parts = [
        part(name, body("visual", what, xyz) + body("collision", what, xyz)) for name, (xyz, what) in contents.items()
    ]
    parts += [hinge("j1", "base", "turn", LIMIT, 0.1), hinge("s", "turn", "tip", slide, low, kind="prismatic")]
    return arm(folder, *(each.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>') for each in parts))


def test_a_pair_that_can_really_touch_is_never_excused_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    source = sliding(tmp_path, -0.023, 0.0025)
    for command in (["check", str(source)], ["import", str(source), "--yes", "--output", str(tmp_path / "urdf")]):
        assert run(command) is ExitCode.FAILED
        said = capsys.readouterr().out
        assert "pair base and tip: they are always near (-23.0 to 2.5 mm) and come to touch as they are drawn" in said
        assert 'write "excuse.base.tip" = "yes" into a file for `gemelo import --answers`' in said
    assert not (tmp_path / "urdf").exists()
    answers = tmp_path / "answers.toml"
    answers.write_text('"excuse.base.tip" = "yes"\n')
    folder = imported(source, tmp_path / "urdf", "--answers", str(answers))
    assert reasons(folder)["base", "tip"] == "User"


def test_a_pair_that_always_touches_is_excused(tmp_path: Path):
    assert reasons(imported(sliding(tmp_path, -0.023, -0.013), tmp_path / "urdf"))["base", "tip"] == "Always"


def reasons(folder: Path) -> dict[tuple[str, ...], str]:
    return {tuple(sorted(each.pair)): each.reason for each in entries((folder / "robot.srdf").read_text())}


def test_home_is_zero_but_for_what_needs_room_and_only_joints_of_the_arm_are_blamed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    text = jaws(tmp_path, 0.003).read_text().replace('upper="0.03"', 'upper="0.003"')
    text = text.replace('child link="left"/><origin xyz="0 0 0.2"/>', 'child link="left"/><origin xyz="0 0.002 0.21"/>')
    text = text.replace(
        'child link="right"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>',
        'child link="right"/><origin xyz="0 -0.002 0.21"/><axis xyz="0 -1 0"/>',
    ).replace("</visual></link>", "</visual>" + body("collision", JAW_BOX) + "</link>")
    (tmp_path / "arm.urdf").write_text(text)
    loaded = load_arm(imported(tmp_path / "arm.urdf", tmp_path / "urdf"))
    home = loaded.named_states["home"]
    assert home[:3] == (0.0, 0.0, 0.0)
    assert 0.002 < home[3] <= 0.003
    said = capsys.readouterr().out
    assert 'note: robot.srdf: state "home": home is not at zero, where left and right touch: it is at jaw 0.00' in said
    closed = JointState(name=loaded.joint_names, position=(0.0, 0.0, 0.0, 0.003))
    goal = PoseGoal(position=(0.0, 0.0, 5.0))
    refusal = Planner(loaded).plan(PlanRequest(goal=goal, start=closed), None).refusal
    assert refusal is not None
    assert "out of reach" in refusal.message
    assert "jaw" not in refusal.message


JAW_BOX = '<geometry><box size="0.01 0.004 0.03"/></geometry>'


def test_a_long_name_is_cut_for_the_device_and_two_of_them_stay_two(tmp_path: Path):
    names = [f"Robotic_Arm_Assembly_6DOF_URDF_v{number}" for number in (2, 3)]
    devices = set()
    for name in names:
        source = arm(tmp_path / name, boxes(), hinges(), name=name)
        found = survey(source)
        (said,) = (each for each in found.findings if "a device has 31" in each.message)
        assert said.line == 2
        assert found.description is not None
        toml = found.description.robot_toml(dict.fromkeys(("j1", "j2", "j3"), 0.0))
        assert f'name = "{name}"' in toml
        devices.add(said.remedy)
    assert len(devices) == 2


def test_screws_are_one_part_with_what_they_are_fixed_to(tmp_path: Path):
    screw = '<geometry><cylinder radius="0.002" length="0.01"/></geometry>'
    parts = [boxes(), hinges()]
    for number in range(90):
        parts.append(part(f"screw{number}", body("visual", screw, "0 0 0") + body("collision", screw, "0 0 0")))
        parts.append(hinge(f"s{number}", "hand", f"screw{number}", "", 0.001 * number, kind="fixed"))
    found = survey(arm(tmp_path, *parts))
    assert found.description is not None
    model = found.description.mended.model
    assert sum(bool(link.collisions) for link in model.links) == 4 < MOST_PARTS
    hand = next(link for link in model.links if link.name == "hand")
    assert [shape.origin.xyz[2] for shape in hand.collisions[1:]] == pytest.approx([0.001 * n for n in range(90)])
    (said,) = (each for each in found.findings if "one part" in each.remedy)
    assert (said.line, said.message) == (6, "90 links with shapes are fixed to it, of 94 links in all")


def test_a_mesh_of_too_many_triangles_keeps_its_shape():
    ball = trimesh.creation.icosphere(6, 0.1)
    smaller, moved = coarser(ball, 20_000)
    assert 5_000 < len(smaller.faces) <= 20_000
    assert moved < 0.005
    assert np.linalg.norm(smaller.vertices, axis=1) == pytest.approx(0.1, abs=0.002)
    assert smaller.volume == pytest.approx(ball.volume, rel=0.02)


@pytest.mark.full
def test_an_arm_of_a_mesh_of_600_000_triangles_is_imported_with_a_coarser_copy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = tmp_path / "in"
    heights = np.linspace(0.0, 0.2, 301)
    profile = np.column_stack((np.r_[0.0, np.full(301, 0.03), 0.0], np.r_[0.0, heights, 0.2]))
    fine = trimesh.creation.revolve(profile, sections=1000)
    source = arm(folder, boxes(upper=meshed("fine.stl")), hinges())
    (folder / "fine.stl").write_bytes(trimesh.exchange.stl.export_stl(fine))
    output = imported(source, tmp_path / "out")
    assert f"has {len(fine.faces)} triangles, more than {MOST_TRIANGLES} -> its copy is made" in capsys.readouterr().out
    copy = trimesh.load_mesh(output / "meshes/fine.stl")
    assert len(copy.faces) <= MOST_COARSER
    assert np.ptp(copy.vertices, axis=0) == pytest.approx(np.ptp(fine.vertices, axis=0), abs=0.001)


def test_axes_that_rounding_has_shortened_are_no_fault(tmp_path: Path):
    first, *rest = hinges().splitlines()
    found = survey(arm(tmp_path, boxes(), first.replace("0 0 1", "0 0.0008 0.9999"), *rest))
    assert [each.message for each in found.findings] == []
