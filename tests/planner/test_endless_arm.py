"""A small arm of five joints without limits and a jaw, as hobby arms are exported: every free pose can be gone to."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest, PoseGoal
from gemelo.services.planner.core import Planner
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.request.deadline import NEVER

BOX = '<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
LINKS = {
    "base": ("0 0 0.03", "0.10 0.10 0.06"),
    "column": ("0 0 0.02", "0.06 0.06 0.04"),
    "upper": ("0 0 0.055", "0.03 0.03 0.13"),
    "lower": ("0 0 0.06", "0.03 0.03 0.14"),
    "wrist": ("0 0 0.025", "0.028 0.028 0.06"),
    "hand": ("0 0.012 0.03", "0.05 0.02 0.07"),
    "jaw": ("0 -0.03 0.025", "0.02 0.01 0.06"),
}
JOINTS = (
    ("pan", "base", "column", "0 0 0.065", "0 0 1"),
    ("lift", "column", "upper", "0.03 0 0.045", "0 1 0"),
    ("elbow", "upper", "lower", "0.028 0 0.115", "0 1 0"),
    ("flex", "lower", "wrist", "0 0 0.135", "0 1 0"),
    ("roll", "wrist", "hand", "0 0 0.06", "0 0 1"),
)
APART = 0.006  # [m] of starts and goals from everything
PAIRS = 25


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Planner:
    folder = tmp_path_factory.mktemp("robots") / "endless"
    folder.mkdir()
    lines = [f'<link name="{name}">{BOX.format(at=at, size=size)}</link>' for name, (at, size) in LINKS.items()]
    lines += [
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/><limit effort="2" velocity="3"/></joint>'
        for name, parent, child, at, axis in JOINTS
    ]
    lines.append(
        '<joint name="grip" type="revolute"><parent link="hand"/><child link="jaw"/><origin xyz="0 -0.02 0.02"/>'
        '<axis xyz="1 0 0"/><limit lower="-0.2" upper="1.8" effort="2" velocity="3"/></joint>'
        '<joint name="tip" type="fixed"><parent link="hand"/><child link="tool"/><origin xyz="0 0 0.08"/></joint>'
    )
    urdf = "\n".join(['<robot name="endless">', *lines, '<link name="tool"/>', "</robot>"])
    (folder / "robot.urdf").write_text(urdf)
    (folder / "robot.toml").write_text('name = "endless"\nbase_frame = "base"\ntool_frame = "tool"\n')
    names = [*LINKS]
    excused = "".join(
        f'<disable_collisions link1="{one}" link2="{other}" reason="Adjacent"/>'
        for one, other in [*pairwise(names), ("wrist", "jaw")]
    )
    chain = '<group name="arm"><chain base_link="base" tip_link="tool"/></group>'
    (folder / "robot.srdf").write_text(f'<robot name="endless">{chain}{excused}</robot>')
    planner = Planner(load_arm(folder))
    planner.prepare()
    return planner


@pytest.fixture(scope="module")
def free(planner: Planner) -> list[tuple[float, ...]]:
    """Configurations, two for each problem."""
    random, found = np.random.default_rng(2), list[tuple[float, ...]]()
    lower = [max(joint.lower, -np.pi) for joint in planner.arm.joints]
    upper = [min(joint.upper, np.pi) for joint in planner.arm.joints]
    while len(found) < 2 * PAIRS:
        row = random.uniform(lower, upper)
        if planner.checker.distance(row) > APART:
            found.append(tuple(row.tolist()))
    return found


def pose_of(planner: Planner, configuration: tuple[float, ...]) -> PoseGoal:
    tool = planner.kinematics.tool(configuration)
    return PoseGoal(
        position=tuple(tool.position.tolist()), orientation=tuple(pin.Quaternion(tool.rotation).coeffs().tolist())
    )


@pytest.mark.parametrize("kind", ["joints", "pose"])
def test_every_free_configuration_and_every_pose_of_one_can_be_gone_to(planner: Planner, free: list, kind: str):
    refused = []
    for start, goal in zip(free[::2], free[1::2], strict=True):
        wanted = pose_of(planner, goal) if kind == "pose" else JointGoal(name=planner.arm.joint_names, position=goal)
        state = JointState(name=planner.arm.joint_names, position=start)
        response = planner.plan(PlanRequest(start=state, goal=wanted, allowed_time=5.0), None)
        if response.refusal is not None:
            refused.append(response.refusal.message)
            continue
        end = response.trajectory.points[-1].positions
        if kind == "pose":
            assert end[-1] == start[-1], "the jaw does not move the tool and stays"
            assert np.allclose(planner.kinematics.tool(end).position, wanted.position, atol=1e-4)
    assert refused == []


def test_configurations_of_a_pose_are_less_than_half_a_turn_away_and_are_told_once(planner: Planner, free: list):
    goals = Goals(planner.arm, planner.kinematics, planner.checker)
    for start, goal in zip(free[:16:2], free[1:16:2], strict=True):
        rows = np.array(list(goals.candidates(pose_of(planner, goal), start, NEVER)))
        assert np.abs(rows - start).max() < np.pi + 1e-6
        turned = np.concatenate((np.cos(rows), np.sin(rows)), axis=1)
        apart = np.linalg.norm(turned[:, None] - turned[None], axis=2) + 9.0 * np.eye(len(rows))
        assert apart.min() > 1e-5, rows
