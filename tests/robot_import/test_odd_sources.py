"""Odd sources of strangers: each is imported as what it means, or refused once, with its lines and what would do."""

from __future__ import annotations

import math
import re
from pathlib import Path

import pytest

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.robot_import.limits import ask_limits
from gemelo.libraries.robot_import.link_mending import shapeless
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import LIMIT, joint, write

BOX = '<geometry><box size="0.06 0.06 0.2"/></geometry>'
LINKS = tuple(f'<link name="{name}"><visual>{BOX}</visual></link>' for name in ("base", "a", "b"))  # lines 3 to 5
FIRST, SECOND = joint("one", "base", "a"), joint("two", "a", "b")  # lines 6 and 7


def mended(folder: Path, *parts: str) -> Mended:
    found = mend(find_source(write(folder / "odd.urdf", "odd", *parts)))
    ask_limits(found, Questions({}, takes_defaults=True))
    return found


def said_of(folder: Path, *parts: str) -> list[str]:
    """What is said of a robot of these lines, without the file's name."""
    return [re.sub(r"odd\.urdf(, )?", "", str(each)) for each in mended(folder, *parts).findings()]


NAN = "<{}><geometry><cylinder radius='nan' length='0.2'/></geometry></{}>"
ODD = {
    "a size that is none, in both roles": (
        (LINKS[0], f'<link name="a">\n{NAN.format("visual", "visual")}\n{NAN.format("collision", "collision")}</link>',
         LINKS[2], FIRST, SECOND),
        'error: lines 5 and 6: link "a": `radius` of <cylinder> is "nan", not a number above 0 -> leave it out, '
        "or correct it",
    ),
    "an origin at infinity": (
        (*LINKS, FIRST.replace("0 0 0.23", "0 0 inf"), SECOND),
        'error: line 6: joint "one": `xyz` of <origin>: inf is not finite -> write a number',
    ),
    "two parents": (
        (*LINKS, FIRST, SECOND, joint("three", "base", "b")),
        'error: lines 7 and 8: link "b": is the child of 2 joints: "two", "three" -> a link has one parent: remove '
        "one of these joints, as no loop is followed",
    ),
    "two links of one name": (
        (*LINKS, FIRST, SECOND, LINKS[1]),
        'error: lines 4 and 8: link "a": is there 2 times -> names are unique: rename or remove one',
    ),
    "two joints of one name": (
        (*LINKS, FIRST, SECOND.replace("two", "one")),
        'error: lines 6 and 7: joint "one": is there 2 times -> names are unique: rename or remove one',
    ),
    "three roots": (
        (*LINKS, '<link name="c"/>', joint("one", "base", "a")),
        "error: lines 3, 5 and 6: tree: has 3 roots (base, b, c) -> join them with a fixed joint, or remove what is no "
        "part of the arm",
    ),
    "a ring beside the root": (
        (*LINKS, joint("one", "b", "a"), SECOND),
        'error: lines 6 and 7: link "a": is not connected to a root: its joints form a ring, "two", "one" -> correct '
        "<parent> or <child> of the joint that closes it, or remove that joint",
    ),
    "a ring and no root": (
        (*LINKS[1:], joint("one", "b", "a"), SECOND),
        'error: lines 5 and 6: link "a": is not connected to a root: its joints form a ring, "two", "one" -> correct '
        "<parent> or <child> of the joint that closes it, or remove that joint",
    ),
    "its own parent": (
        (*LINKS, FIRST, joint("two", "b", "b")),
        'error: line 7: link "b": is not connected to a root: its joints form a ring, "two" -> correct <parent> or '
        "<child> of the joint that closes it, or remove that joint",
    ),
    "a parent that is no link": (
        (*LINKS, joint("one", "bas", "a"), SECOND),
        'error: line 6: joint "one": its parent "bas" is no link -> did you mean "base"?, or write the name of a link '
        "in <parent>",
    ),
    "a joint without a name": (
        (*LINKS, FIRST, SECOND.replace('name="two" ', "")),
        "error: line 7: <joint>: attribute `name` of <joint> is missing -> add it",
    ),
    "a scale of one number": (
        (LINKS[0], '<link name="a"><visual><geometry><mesh filename="a.stl" scale="0.001"/></geometry></visual></link>',
         LINKS[2], FIRST, SECOND),
        'error: line 4: link "a", <mesh>: `scale` of <mesh>: "0.001" must be three numbers -> write "0.001 0.001 '
        '0.001"',
    ),
    "two shapes in one": (
        (LINKS[0], LINKS[1].replace("<geometry>", '<geometry><sphere radius="1"/>'), LINKS[2], FIRST, SECOND),
        'error: line 4: link "a": a <geometry> has 2 shapes, it must have one -> give each a <visual> of its own',
    ),
    "a leader that is no joint": (
        (*LINKS, FIRST, SECOND.replace("</joint>", '<mimic joint="none"/></joint>')),
        'error: line 7: joint "two": mimics "none", which is no joint -> did you mean "one"?, or name the joint that '
        "has the motor in <mimic>",
    ),
    "two limits": (
        (*LINKS, FIRST, SECOND.replace("</joint>", '<limit lower="-1" upper="1" effort="9" velocity="1"/></joint>')),
        'error: line 7: joint "two": <limit> is there 2 times, and they differ -> leave one',
    ),
    "two origins of one shape": (
        (LINKS[0], LINKS[1].replace("<geometry>", '<origin xyz="0 0 1"/>\n<origin xyz="0 0 2"/><geometry>'), LINKS[2],
         FIRST, SECOND),
        'error: lines 4 and 5: link "a": <origin> is there 2 times, and they differ -> leave one',
    ),
    "a link within another": (
        (LINKS[0], LINKS[1].replace("</link>", '\n<link name="c"/></link>'), LINKS[2], FIRST, SECOND),
        'error: line 5: link "c": it stands within link "a", where nothing reads it -> move it behind that one',
    ),
    "an endless joint with limits": (
        (*LINKS, joint("one", "base", "a", kind="continuous"), SECOND),
        'warning: line 6: joint "one": is continuous, which turns beyond its limits -2.6 to 2.6 -> write '
        'type="revolute" where it must stay within them',
    ),
}  # fmt: skip


@pytest.mark.parametrize(("parts", "expected"), ODD.values(), ids=list(ODD))
def test_what_is_wrong_is_said_once_with_its_lines_and_what_would_do(
    tmp_path: Path, parts: tuple[str, ...], expected: str
):
    said = said_of(tmp_path, *parts)
    assert said.count(expected) == 1, said
    assert all(" -> " in each and re.match(r"\w+: lines? \d", each) for each in said if not each.startswith("note"))


MENDED = {
    "commas": (FIRST.replace("0 0 0.23", "0,0,0.23"), 'xyz="0,0,0.23" has commas between its numbers'),
    "commas and blanks": (FIRST.replace("0 0 0.23", "0, 0, 0.23"), 'xyz="0, 0, 0.23" has commas between its numbers'),
    "capitals": (FIRST.replace("revolute", "Revolute"), 'type "Revolute" is no type -> type="revolute"'),
}


@pytest.mark.parametrize(("first", "expected"), MENDED.values(), ids=list(MENDED))
def test_how_numbers_and_types_are_written_is_mended(tmp_path: Path, first: str, expected: str):
    found = mended(tmp_path, *LINKS, first, SECOND)
    (said,) = map(str, found.findings())
    assert expected in said
    assert found.model.joints == mended(tmp_path / "plain", *LINKS, FIRST, SECOND).model.joints


def test_the_same_element_twice_is_no_fault(tmp_path: Path):
    twice = SECOND.replace("</joint>", f"{LIMIT}\n</joint>")
    assert said_of(tmp_path, *LINKS, FIRST, twice) == said_of(tmp_path / "once", *LINKS, FIRST, SECOND) == []


@pytest.mark.parametrize(("kind", "unit"), [("revolute", "rad"), ("prismatic", "m")])
def test_a_joint_that_its_limits_lock_stands_there_and_what_follows_it_too(tmp_path: Path, kind: str, unit: str):
    locked = LIMIT.replace('"-2.6"', '"0.5"').replace('"2.6"', '"0.5"')
    follower = joint("two", "a", "b", rest=f'{LIMIT}<mimic joint="one" multiplier="2" offset="0.1"/>')
    third = joint("three", "b", "c")
    parts = (*LINKS, '<link name="c"/>', joint("one", "base", "a", kind=kind, rest=locked), follower, third)
    found = mended(tmp_path, *parts)
    said = f'line 7: joint "one": its limits hold it at 0.5 {unit} -> type="fixed" there: '
    assert [str(each) for each in found.findings() if said in str(each)]
    assert [each.kind for each in found.model.joints] == ["fixed", "fixed", "revolute"]
    free = mend(find_source(write(tmp_path / "free.urdf", "free", *(each.replace(locked, LIMIT) for each in parts))))
    expected = link_transforms(free.model, {"one": 0.5, "two": 1.1})
    for name, (position, turn) in link_transforms(found.model, {}).items():
        assert position == pytest.approx(expected[name][0], abs=1e-8)
        assert turn == pytest.approx(expected[name][1], abs=1e-8)


def test_limits_that_are_both_zero_are_none(tmp_path: Path):
    none = LIMIT.replace('"-2.6"', '"0"').replace('"2.6"', '"0"')
    found = mended(tmp_path, *LINKS, FIRST, joint("two", "a", "b", rest=none))
    limit = found.model.joint("two").limit
    assert limit is not None
    assert (limit.lower, limit.upper) == pytest.approx((-math.pi, math.pi))


def test_a_decimal_comma_is_no_comma_between_numbers(tmp_path: Path):
    said = said_of(tmp_path, *LINKS, FIRST.replace("0 0 0.23", "0,5 1,5 2"), SECOND)
    assert any('"0,5" is not a number -> write "0.5"' in each for each in said)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("<sdf version='1.6'/>", r"the root element is <sdf>, it must be <robot>: export it as URDF"),
        ("<robot><link", r"not XML: unclosed token: line 1, column 8: correct that place, or export it again"),
    ],
)
def test_what_is_no_urdf_says_what_would_do(tmp_path: Path, text: str, expected: str):
    (tmp_path / "odd.urdf").write_text(text)
    with pytest.raises(DescriptionError, match=expected):
        mend(find_source(tmp_path))


def test_a_robot_without_any_shape_is_drawn_as_rods_from_joint_to_joint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    bare = [f'<link name="{name}"/>' for name in ("base", "a", "b", "c")]
    tilted = joint("three", "b", "c").replace("0 0 0.23", "0.1 -0.2 -0.05")
    source = write(tmp_path / "bare.urdf", "bare", *bare, FIRST, SECOND, tilted)
    assert run(["import", str(source), "--yes", "--output", str(tmp_path / "urdf")]) is ExitCode.OK
    assert "line 2: robot: no link has a <visual> or <collision> -> each is a rod of 11.5 mm" in capsys.readouterr().out
    arm = load_arm(tmp_path / "urdf" / "bare")
    assert not [each for each in check(arm.folder) if each.severity is Severity.ERROR]
    shapes = {link.name: link.collisions for link in arm.model.links}
    assert [each[0].shape for each in shapes.values()] == ["cylinder", "cylinder", "cylinder", "sphere"]
    rod = shapes["b"][0]
    assert rod.size[1] == pytest.approx(math.hypot(0.1, 0.2, 0.05))
    assert rod.origin.xyz == pytest.approx((0.05, -0.1, -0.025))
    pitch, yaw = rod.origin.rpy[1:]
    along = (math.sin(pitch) * math.cos(yaw), math.sin(pitch) * math.sin(yaw), math.cos(pitch))
    end = link_transforms(arm.model, {})["c"][0]
    start = link_transforms(arm.model, {})["b"][0]
    assert [rod.size[1] * value for value in along] == pytest.approx([b - a for a, b in zip(start, end, strict=True)])


def test_a_robot_without_shapes_and_lengths_is_refused(tmp_path: Path):
    links = ['<link name="base"/>', '<link name="a"/>']
    found = mended(tmp_path, *links, joint("one", "base", "a", z=0.0))
    assert "nothing could be drawn" in str(shapeless(found)[0])
