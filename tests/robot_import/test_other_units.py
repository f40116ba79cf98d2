"""Sources in other units as a whole: drawn in millimetres, turned in degrees, weighed in grams."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.urdf import UrdfModel
from gemelo.libraries.robot_import.limits import ask_limits
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.arm.bare_arm import write_bare_arm
from tests.robot_import.exports import LIMIT, joint, link, mesh, write

BOX = '<visual><geometry><box size="0.06 0.06 0.2"/></geometry></visual>'
INERTIAL = (
    '<inertial><origin xyz="0 0 {half}"/><mass value="0.9"/>'
    '<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>'
)


def drawn(folder: Path, unit: float, moment: float = 0.002, shape: str = "") -> Mended:
    """An arm that turns and slides, with a jaw and its follower: its lengths in units of 1/`unit` m."""

    def text(*values: float) -> str:
        return " ".join(f"{unit * value:g}" for value in values)

    def part(name: str, geometry: str) -> str:
        inertial = INERTIAL.format(half=text(0.1), i=moment)
        both = f'<origin xyz="{text(0, 0, 0.1)}"/><geometry>{shape or geometry}</geometry>'
        return f'<link name="{name}">{inertial}<visual>{both}</visual><collision>{both}</collision></link>'

    box = f'<box size="{text(0.06, 0.06, 0.2)}"/>'
    tube = f'<cylinder radius="{text(0.02)}" length="{text(0.2)}"/>'
    ball = f'<sphere radius="{text(0.01)}"/>'
    slide = f'<limit lower="0" upper="{text(0.15)}" effort="9" velocity="{text(0.1)}"/>'
    led = slide.replace(f'upper="{text(0.15)}"', f'upper="{text(0.35)}"')
    follower = f'<mimic joint="slide" multiplier="2" offset="{text(0.01)}"/>'
    crank = f'<mimic joint="slide" multiplier="{3.0 / unit:g}" offset="0.5"/>'
    file = write(
        folder / "arm.urdf", "arm",
        part("base", box), part("one", tube), part("two", box), part("three", ball), part("four", ball),
        joint("turn", "base", "one", z=0.23 * unit),
        joint("slide", "one", "two", "0 0 1", "prismatic", slide, 0.3 * unit),
        joint("jaw", "two", "three", "0 0 1", "prismatic", led + follower, 0.2 * unit),
        joint("crank", "two", "four", rest=LIMIT + crank, z=0.25 * unit),
    )  # fmt: skip
    found = mend(find_source(file))
    ask_limits(found, Questions({}, takes_defaults=True))
    return found


def said_of(found: Mended) -> list[str]:
    """All findings but those about the followers."""
    return [str(each) for each in found.findings() if "gets no motor" not in each.remedy]


def assert_equal(one: UrdfModel, other: UrdfModel) -> None:
    """The same lengths [m], limits and moments, to nine digits."""

    def numbers(model: UrdfModel) -> list[float]:
        return [float(word) for word in re.findall(r"-?\d+\.\d+(?:e-?\d+)?", re.sub(r"line=\d+", "", repr(model)))]

    assert numbers(one) == pytest.approx(numbers(other), rel=1e-8)


@pytest.mark.parametrize("moment", [0.002, 2000.0])
def test_a_urdf_in_millimetres_becomes_the_same_arm_in_metres_and_says_so_once(tmp_path: Path, moment: float):
    metres, mended = drawn(tmp_path / "m", 1.0), drawn(tmp_path / "mm", 1000.0, moment)
    assert_equal(metres.model, mended.model)
    assert said_of(metres) == []
    (said,) = said_of(mended)
    assert 'arm.urdf, line 9: robot: its joints span 980 m, <origin> of joint "slide" is 300 m' in said
    assert "it is in millimetres -> all lengths by 0.001" in said
    assert link_transforms(mended.model, {"turn": 0.0, "slide": 0.1})["two"][0] == pytest.approx((0.0, 0.0, 0.63))


@pytest.mark.parametrize(("scale", "written"), [(1000.0, ""), (1000.0, "0.001 0.001 0.001"), (1.0, "")])
def test_meshes_of_a_urdf_in_millimetres_keep_the_size_that_they_have_for_themselves(
    tmp_path: Path, scale: float, written: str
):
    mesh(tmp_path, "part.stl", scale=scale)
    names = ("a", "b", "c")
    joints = (joint("one", "a", "b", z=230.0), joint("two", "b", "c", z=230.0))
    found = mend(find_source(write(tmp_path / "m.urdf", "m", *(link(x, "part.stl", written) for x in names), *joints)))
    assert len([each for each in found.findings() if "its joints span 460 m" in str(each)]) == 1
    assert not [each for each in found.findings() if each.severity is not Severity.NOTE]
    assert [each.origin.xyz[2] for each in found.model.joints] == pytest.approx([0.23, 0.23])
    for each in found.model.links:
        assert max(each.visuals[0].scale) * scale == pytest.approx(1.0)
        assert each.inertial is not None
        assert each.inertial.origin.xyz[2] == pytest.approx(0.0001)  # 0.1 mm: in the file's unit, as all others


def test_one_length_in_millimetres_among_metres_is_named_with_its_line_and_what_to_write(tmp_path: Path):
    box = '<visual><geometry><box size="0.06 0.06 {}"/></geometry></visual>'
    links = [
        f'<link name="{name}">{box.format(length)}</link>'
        for name, length in {"a": 0.2, "b": 0.2, "c": 200, "d": 6}.items()
    ]
    far = write(
        tmp_path / "far.urdf", "far", *links,
        joint("one", "a", "b"), joint("two", "b", "c", z=400.0), joint("x", "c", "d"),
    )  # fmt: skip
    said = [str(each) for each in mend(find_source(far)).findings()]
    assert said == [
        'error: far.urdf, line 8: joint "two": <origin> is 400 m -> is that in mm? then write xyz="0 0 0.4"',
        'error: far.urdf, line 5: link "c": <box> is 200 m -> is that in mm? then write 6e-05 x 6e-05 x 0.2',
        'warning: far.urdf, line 6: link "d": <box> is 6 m -> is that in mm? then write 6e-05 x 6e-05 x 0.006',
    ]


def test_a_large_gantry_in_metres_is_no_arm_in_millimetres(tmp_path: Path):
    box = '<visual><geometry><box size="12 0.2 0.2"/></geometry></visual>'
    slides = '<limit lower="0" upper="4.5" effort="9" velocity="1"/>'
    links = [f'<link name="{name}">{box}</link>' for name in "abc"]
    file = write(
        tmp_path / "crane.urdf", "crane", *links,
        joint("one", "a", "b", kind="prismatic", rest=slides, z=7.0), joint("two", "b", "c", rest=slides, z=8.0),
    )  # fmt: skip
    assert {each.severity for each in mend(find_source(file)).findings()} == {Severity.WARNING}


def test_check_of_a_robot_says_that_it_is_in_millimetres(tmp_path: Path):
    urdf = write_bare_arm(tmp_path) / "robot.urdf"
    urdf.write_text(urdf.read_text().replace('<parent link="', '<origin xyz="0 0 230"/><parent link="'))
    (said,) = [each for each in check(tmp_path) if "it is in millimetres" in each.message]
    assert (said.severity, said.line) == (Severity.ERROR, 3)
    assert "`gemelo import` writes it in metres" in said.remedy


def turned(folder: Path, *turns: str) -> Mended:
    """An arm whose joints' origins are turned so."""
    links = [f'<link name="l{number}">{BOX}</link>' for number in range(len(turns) + 1)]
    joints = [
        joint(f"j{number}", f"l{number}", f"l{number + 1}").replace('rpy="0 0 0"', f'rpy="{turn}"')
        for number, turn in enumerate(turns)
    ]
    return mend(find_source(write(folder / "turned.urdf", "turned", *links, *joints)))


def test_turns_in_degrees_are_turned_in_radians_and_said_once(tmp_path: Path):
    found = turned(tmp_path, "0 90 0", "0 -45 180", "0 0 2.5")
    (said,) = map(str, found.findings())
    assert 'turned.urdf, line 7: <origin>: rpy="0 90 0" is in degrees, and so are all of its 3' in said
    rpys = [each.origin.rpy for each in found.model.joints]
    np.testing.assert_allclose(rpys, np.radians([[0, 90, 0], [0, -45, 180], [0, 0, 2.5]]), atol=1e-8)


def test_a_turn_that_is_none_among_radians_is_said_with_what_it_would_be(tmp_path: Path):
    found = turned(tmp_path, "0 1.5708 0", "0 90 0", "0 0 -3.14159")
    (said,) = map(str, found.findings())
    assert said.startswith('warning: turned.urdf, line 8: joint "j1": rpy="0 90 0" is more than a turn')
    assert 'are these degrees? then write rpy="0 1.5708 0"' in said
    assert found.model.joint("j1").origin.rpy == (0.0, 90.0, 0.0)


def test_masses_in_grams_are_said_once(tmp_path: Path):
    found = drawn(tmp_path, 1.0)
    for mass in found.xml.root.iter("mass"):
        mass.set("value", "900")
    (said,) = said_of(found)
    assert 'robot: its links weigh 4500 kg in all, "base" 900 kg -> are these grams?' in said


def test_moments_in_gram_millimetres_are_those_of_no_body(tmp_path: Path):
    found = drawn(tmp_path, 1.0, moment=2e6)
    assert len(said_of(found)) == 5
    assert all("they are in another unit -> left out" in said for said in said_of(found))


@pytest.mark.parametrize("minus", ["\u2212", "\u2013"])
def test_a_minus_sign_of_print_is_one(tmp_path: Path, minus: str):
    limit = f'<limit lower="{minus}1.5" upper="1.5" effort="1" velocity="1"/>'
    links = f'<link name="a">{BOX}</link><link name="b">{BOX}</link>'
    parts = (links, joint("one", "a", "b", axis=f"0 {minus}1 0", rest=limit))
    found = mend(find_source(write(tmp_path / "minus.urdf", f"a{minus}b", *parts)))
    (said,) = map(str, found.findings())
    assert "has a minus sign of print, as 2 of its numbers have" in said
    assert found.model.joint("one").axis == (0.0, -1.0, 0.0)
    assert found.model.joint("one").limit.lower == -1.5  # type: ignore[union-attr]


def test_check_of_a_urdf_in_millimetres_says_what_import_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    drawn(tmp_path, 1000.0)
    assert run(["check", str(tmp_path / "arm.urdf")]) is ExitCode.OK
    assert "it is in millimetres -> all lengths by 0.001" in capsys.readouterr().out
