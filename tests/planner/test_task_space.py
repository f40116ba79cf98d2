"""The task space of arms, read from their joints: real arms, and arms that lack joints."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.planning import PoseGoal
from gemelo.schemas.reasons import remedy
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.kinematics.targets import AxisPointing, ToolTarget
from gemelo.services.planner.kinematics.task_space import TaskSpace, task_space
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.request.refusals import PlanRefused

ROOT = Path(__file__).parents[2] / "urdf"


def of(arm: ArmDescription) -> TaskSpace:
    return task_space(arm, Kinematics(arm))


def without(joints: list[str], folder: Path) -> ArmDescription:
    """parol6, some of whose joints are fixed."""
    source = ROOT / "parol6"
    for file in ("robot.urdf", "robot.srdf", "robot.toml"):
        text = (source / file).read_text()
        for name in joints:
            text = re.sub(f'(<joint name="{name}" type=)"revolute"', r'\1"fixed"', text)
            text = re.sub(f'\\s*<joint name="{name}" value=[^>]*>', "", text)
        (folder / file).write_text(without_drives(text, joints) if file == "robot.toml" else text)
    (folder / "meshes").symlink_to(source / "meshes")
    return load_arm(folder)


def without_drives(text: str, joints: list[str]) -> str:
    """robot.toml without the [[joint]] of these."""
    tables = re.split(r"(?m)^(?=\[\[joint\]\])", text)
    return "".join(table for table in tables if not any(f'name = "{name}"' in table for name in joints))


def test_rm1_only_yaws_and_that_follows_from_the_position():
    able = of(load_arm(ROOT / "rm1"))
    assert np.allclose(np.abs(able.axes), [[0.0, 0.0, 1.0]])
    assert able.chosen == 0
    assert str(able.why) == "rm1 cannot tilt its tool, and its yaw follows from the position"
    assert able.remedies == (remedy("position_alone"), remedy("position_and_yaw"))


def test_parol6_can_do_everything():
    able = of(load_arm(ROOT / "parol6"))
    assert (len(able.axes), able.chosen, able.is_full) == (3, 3, True)


@pytest.mark.parametrize(
    ("fixed", "chosen", "code", "remedies"),
    [
        (["joint_6"], 2, "plan.turns.some", ["position_and_axis", "free_axis"]),
        (["joint_4", "joint_6"], 1, "plan.turns.some", ["position_alone", "orientation_tolerance"]),
        (["joint_4", "joint_5", "joint_6"], 0, "plan.turns.follow", ["position_alone"]),
    ],
)
def test_with_fewer_joints_fewer_turns_can_be_chosen(
    fixed: list[str], chosen: int, code: str, remedies: list[str], tmp_path: Path
):
    able = of(without(fixed, tmp_path))
    assert (len(able.axes), able.chosen) == (3, chosen)
    assert (able.why.code, able.why.values["joints"]) == (code, 6 - len(fixed))
    assert [each.code for each in able.remedies] == remedies


def test_an_arm_of_five_joints_points_its_tool_and_says_what_it_cannot_do(tmp_path: Path):
    arm = without(["joint_6"], tmp_path)
    kinematics = Kinematics(arm)
    goals = Goals(arm, kinematics)
    start = tuple(0.5 * (joint.lower + joint.upper) for joint in arm.joints)
    for configuration in np.random.default_rng(2).uniform(-0.3, 0.3, (10, 5)) + start:
        pose = kinematics.tool(configuration)
        x, y, z = pose.position.tolist()
        direction = (pose.rotation @ [0.0, 0.0, 1.0]).tolist()
        goal = PoseGoal(position=(x, y, z), tool_axis=(0.0, 0.0, 1.0), direction=tuple(direction))
        got = kinematics.tool(next(goals.candidates(goal, start, NEVER)))
        assert np.allclose(got.position, pose.position, atol=1e-6)
        assert np.allclose(got.rotation[:, 2], direction, atol=1e-5)
    turn = pin.Quaternion(pin.exp3(pose.rotation @ [0.0, 0.0, 0.5]) @ pose.rotation)
    goal = PoseGoal(position=(x, y, z), orientation=(turn.x, turn.y, turn.z, turn.w))
    with pytest.raises(PlanRefused) as caught:
        next(goals.candidates(goal, start, NEVER))
    assert "has 5 joints: beside a position it can choose 2 of 3 turns" in caught.value.refusal.message
    assert "the direction of one tool axis" in caught.value.refusal.remedy


def test_how_much_tilt_is_missing_does_not_depend_on_the_yaw():
    able = of(load_arm(ROOT / "rm1"))
    for yaw in (0.0, 1.0, -2.5):
        turn = pin.exp3(np.array([0.0, 0.0, yaw])) @ pin.exp3(np.array([0.3, 0.0, 0.0])) @ able.rotation
        assert able.missing_tilt(ToolTarget(np.zeros(3), turn)) == pytest.approx(0.3)
    sideways = AxisPointing(np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))
    assert able.missing_tilt(ToolTarget(np.zeros(3), None, sideways)) == pytest.approx(np.pi / 2.0)
    across = AxisPointing(np.array([1.0, 0.0, 0.0]), np.array([0.6, 0.8, 0.0]))
    assert able.allows(ToolTarget(np.zeros(3), None, across))
