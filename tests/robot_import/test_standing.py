"""Joints that do not carry the tool: wheels and a second arm stand still, a gripper's joints do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.arm.model.virtual_drive import driven_joints
from gemelo.libraries.robot_import.mended import Mended
from gemelo.libraries.robot_import.mending import mend
from gemelo.libraries.robot_import.poses import zero_state
from gemelo.libraries.robot_import.questions import Questions
from gemelo.libraries.robot_import.source import find_source
from gemelo.libraries.robot_import.standing import ask_who_stands
from tests.robot_import.exports import LIMIT, joint, write


def arm(prefix: str, count: int) -> list[str]:
    """Joints and links of one arm on `base`, with two jaws of which one follows the other."""
    links = ["base", *(f"{prefix}_{number}" for number in range(1, count + 1))]
    joints = [joint(f"{prefix}_j{at}", links[at - 1], links[at]) for at in range(1, count + 1)]
    joints += [joint(f"{prefix}_jaw", links[-1], f"{prefix}_finger")]
    joints += [joint(f"{prefix}_jaw2", links[-1], f"{prefix}_finger2", rest=f'{LIMIT}<mimic joint="{prefix}_jaw"/>')]
    return [*(f'<link name="{name}"/>' for name in (*links[1:], f"{prefix}_finger", f"{prefix}_finger2")), *joints]


def robot(path: Path, *parts: str) -> Mended:
    return mend(find_source(write(path / "robot.urdf", "robot", '<link name="base"/>', *parts)))


def driven(found: Mended) -> list[str]:
    return [each.name for each in driven_joints(found.model)]


def asked(found: Mended, tool: str, given: dict[str, str] | None = None) -> Questions:
    questions = Questions(given or {}, takes_defaults=True)
    ask_who_stands(found, tool, questions)
    return questions


def test_of_two_arms_that_are_too_many_the_one_without_the_tool_stands_still(tmp_path: Path):
    for tool, moving in (("left_5", "left"), ("right_5", "right")):
        found = robot(tmp_path, *arm("left", 5), *arm("right", 5))
        asked(found, tool)
        assert driven(found) == [*(f"{moving}_j{number}" for number in range(1, 6)), f"{moving}_jaw"]
        (said,) = (str(each) for each in found.notes if "stand still at 0" in str(each))
        assert "6 joints do not carry the tool" in said
        assert not [each for each in found.findings() if str(each).startswith("error")]


def test_of_two_small_arms_both_are_driven_unless_a_person_wants_otherwise(tmp_path: Path):
    both = robot(tmp_path, *arm("left", 2), *arm("right", 2))
    assert asked(both, "left_2").answers == {"others_stand_still": "no"}
    assert len(driven(both)) == 6
    (said,) = (str(each) for each in both.notes if "do not carry the tool" in str(each))
    assert "that loop is not followed" in said
    one = robot(tmp_path, *arm("left", 2), *arm("right", 2))
    asked(one, "left_2", {"others_stand_still": "yes"})
    assert driven(one) == ["left_j1", "left_j2", "left_jaw"]


def test_wheels_stand_still(tmp_path: Path):
    wheels = [joint(f"w{side}", "base", f"{side}_wheel", kind="continuous") for side in ("left", "right")]
    found = robot(tmp_path, '<link name="left_wheel"/><link name="right_wheel"/>', *arm("arm", 2), *wheels)
    asked(found, "arm_2")
    assert driven(found) == ["arm_j1", "arm_j2", "arm_jaw"]


def test_nothing_is_asked_of_an_arm_with_a_gripper(tmp_path: Path):
    found = robot(tmp_path, *arm("arm", 6))
    assert asked(found, "arm_6").answers == {}
    assert len(driven(found)) == 7


def test_of_more_joints_than_a_device_drives_those_nearest_to_the_tool_are_driven(tmp_path: Path):
    long = robot(tmp_path, *arm("long", 9))
    asked(long, "long_9")
    assert driven(long) == [f"long_j{number}" for number in range(2, 10)]
    both = robot(tmp_path, *arm("left", 5), *arm("right", 5))
    asked(both, "left_5", {"others_stand_still": "no"})
    assert driven(both) == [*(f"left_j{number}" for number in range(1, 6)), "left_jaw"]
    chosen = robot(tmp_path, *arm("long", 9))
    asked(chosen, "long_9", {"driven_joints": "long_j1 long_j2"})
    assert driven(chosen) == ["long_j1", "long_j2"]
    with pytest.raises(DescriptionError, match=r"driven_joints = .*name 1 to 8 joints"):
        asked(
            robot(tmp_path, *arm("long", 9)), "long_9", {"driven_joints": " ".join(f"long_j{n}" for n in range(1, 10))}
        )


@pytest.mark.parametrize("rpy", ["0.3 0.2 1", "0.3 1.5707963267949 1"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_what_cannot_stand_at_0_stands_at_the_limit_nearest_to_it_and_its_follower_too(
    tmp_path: Path, kind: str, rpy: str
):
    limit = '<limit lower="-2" upper="-0.5" effort="1" velocity="1"/>'
    follows = f'{LIMIT}<mimic joint="held" multiplier="-2" offset="0.1"/>'
    parts = [
        joint(
            "held", "base", "held", axis="1 0 0" if rpy.startswith("0.3 1.5") else "0 0.6 0.8", kind=kind, rest=limit
        ).replace('rpy="0 0 0"', f'rpy="{rpy}"'),
        joint("follower", "base", "follower", axis="1 0 0", kind=kind, rest=follows),
    ]
    links = '<link name="held"/><link name="follower"/>'
    found = robot(tmp_path, links, *arm("arm", 2), *parts)
    before = {name: found.model.joint(name) for name in ("held", "follower")}
    asked(found, "arm_2", {"others_stand_still": "yes"})
    place = zero_state([before["held"]])["held"]
    assert -0.6 < place < -0.5
    for name, moved in (("held", place), ("follower", -2 * place + 0.1)):
        joint_now = found.model.joint(name)
        assert joint_now.kind is JointKind.FIXED
        np.testing.assert_allclose(placed(joint_now, 0.0), placed(before[name], moved), atol=1e-8)


def placed(each: UrdfJoint, value: float) -> np.ndarray:
    """(4, 4) the child in the parent at `value` [rad] or [m]."""
    motion = np.eye(4)
    if each.kind is JointKind.PRISMATIC:
        motion[:3, 3] = value * np.array(each.axis)
    elif each.kind is JointKind.REVOLUTE:
        motion = trimesh.transformations.rotation_matrix(value, each.axis)
    origin = trimesh.transformations.euler_matrix(*each.origin.rpy)
    origin[:3, 3] = each.origin.xyz
    return origin @ motion
