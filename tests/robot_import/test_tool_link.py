"""The tool's link that an import takes by default, on trees as exporters and makers of robots write them."""

from __future__ import annotations

import pytest

from services.arm.model.urdf import UrdfModel, urdf_of
from services.robot_import.tool_link import tool_link
from tests.robot_import.exports import LIMIT, joint


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
