"""The tool's link that an import takes by default, on trees as exporters and makers of robots write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.arm.model.urdf import UrdfModel, urdf_of
from gemelo.libraries.robot_import.tool_link import other_tools, tool_link
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.robot_import.exports import LIMIT, joint, link, mesh, write


def tree(*joints: str) -> UrdfModel:
    """A model of "name parent child kind [leader]" each, its links in their order of appearance."""
    parts, links = [], []
    for words in (text.split() for text in joints):
        name, parent, child, kind = words[:4]
        mimic = f'<mimic joint="{words[4]}"/>' if len(words) > 4 else ""
        links += [link for link in (parent, child) if link not in links]
        parts.append(joint(name, parent, child, kind=kind, rest=LIMIT + mimic))
    model, faults = urdf_of(
        f'<robot name="tree">{"".join(f"""<link name="{x}"/>""" for x in links)}{"".join(parts)}</robot>'
    )
    assert not faults
    return model


ARM = ("j1 base upper revolute", "j2 upper wrist revolute")
TREES = {
    "fingers that follow each other, all deeper than the tool": (
        *ARM, "at wrist end_effector_link fixed", "to end_effector_link palm fixed",
        "left palm left_tip revolute", "right palm right_tip revolute left", "far left_tip left_pad revolute left",
        "end_effector_link",
    ),
    "the same without a name to go by": (
        *ARM, "to wrist palm fixed", "a palm part_1 revolute", "b palm part_2 revolute a", "c part_1 part_3 revolute a",
        "palm",
    ),
    "a single jaw": (*ARM, "Jaw wrist Moving_Jaw continuous", "wrist"),
    "a fixed jaw, which the wrist turns, and one beside it": (
        *ARM, "Roll wrist Fixed_Jaw continuous", "open Fixed_Jaw Moving_Jaw continuous", "Fixed_Jaw",
    ),
    "a frame between the jaws": (
        "j1 base upper revolute", "j2 upper gripper revolute", "at gripper gripperframe fixed",
        "gripper gripper moving_jaw revolute", "gripperframe",
    ),
    "two jaws, each with a motor": (*ARM, "a wrist left prismatic", "b wrist right prismatic", "wrist"),
    "a linkage that keeps the tool level": (
        *ARM, "level wrist plate revolute j2", "bar base rod revolute j1", "plate",
    ),
    "wheels beside the arm": (
        "w1 base wheel_1 continuous", "w2 base wheel_2 continuous", *ARM, "wrist",
    ),
    "legs alone": ("leg_1 base link_1 revolute", "leg_2 base link_2 revolute", "link_1"),
    "a knee is no end effector": (
        "hip base thigh revolute", "knee thigh the_knee revolute", "to the_knee foot fixed", "foot",
    ),
}  # fmt: skip


@pytest.mark.parametrize("words", TREES.values(), ids=list(TREES))
def test_the_tool_is_at_the_end_of_the_arm_and_no_jaw(words: tuple[str, ...]):
    *joints, expected = words
    assert tool_link(tree(*joints)) == expected


def test_a_second_link_with_a_tools_name_is_told_but_neither_a_flange_before_it_nor_a_frame_behind_it():
    two = tree(*ARM, "f wrist flange fixed", "a flange welder_tcp fixed", "b flange camera_tool fixed")
    assert other_tools(two, "welder_tcp") == ["camera_tool"]
    assert other_tools(two, "camera_tool") == ["welder_tcp"]
    assert other_tools(two, "flange") == []


def test_an_import_says_which_other_link_could_be_the_tool(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    mesh(tmp_path / "meshes", "part.stl")
    links = [link("base", "meshes/part.stl"), link("arm", "meshes/part.stl"), link("tcp"), link("eef")]
    ends = [joint(f"to_{name}", "arm", name, kind="fixed") for name in ("tcp", "eef")]
    path = write(tmp_path / "robot.urdf", "robot", *links, joint("j1", "base", "arm"), *ends)
    assert run(["import", str(path), "--yes", "--output", str(tmp_path / "urdf")]) is ExitCode.OK
    assert 'the goals are about "tcp", though "eef" could be the tool too' in "".join(capsys.readouterr())
