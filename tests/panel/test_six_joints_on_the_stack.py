"""The page of parol6 on a whole stack, beyond its sliders: six directions of the gizmo, plans, jogs and a program."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, radians

import numpy as np
import pytest

import gemelo
from gemelo.libraries.arm.frames.transforms import from_rpy, multiply
from gemelo.programs import Go, Line, Program
from gemelo.services.panel.model.tool_turns import ALL_RINGS
from gemelo.services.panel.words.en import ENGLISH
from gemelo.tools.stack.stack import Stack
from tests.panel.person import until
from tests.panel.served import Served, rests
from tests.stacks.shared import found_by_scripts


@pytest.fixture(scope="module")
def twin(parol6_stack: Stack) -> Iterator[Stack]:
    with found_by_scripts(parol6_stack):
        yield parol6_stack


@pytest.fixture(autouse=True)
def ready(served: Served, arm: gemelo.Arm) -> None:
    """With room for the tool on all sides and the goal there."""
    arm.move(named="ready")
    until(lambda: served.operator.arm.joints, lambda joints: joints == arm.joints)
    served.operator.follow_measured()
    there = pytest.approx(arm.pose().position, abs=1e-6)
    until(lambda: served.operator.goal.goal, lambda goal: goal.joints == arm.joints and goal.pose.position == there)


def turned_by(one: gemelo.Pose, other: gemelo.Pose) -> float:
    """[deg] from one orientation to the other."""
    return degrees(2.0 * np.arccos(min(1.0, abs(float(np.dot(one.orientation, other.orientation))))))


def test_the_gizmo_leads_the_goal_in_six_directions_and_a_plan_goes_exactly_there(
    served: Served, arm: gemelo.Arm
) -> None:
    goal, [gizmo] = served.operator.goal, served.world.gizmos  # arrows and rings in one
    assert goal.turns.rings == goal.turns.arrows == ALL_RINGS
    assert not gizmo.disable_rotations
    for axis in range(6):
        before = goal.goal.pose
        offset, turn = np.zeros(3), np.zeros(3)
        (offset if axis < 3 else turn)[axis % 3] = 0.015 if axis < 3 else radians(6.0)
        x, y, z = (np.array(before.position) + offset).tolist()
        wanted = gemelo.Pose((x, y, z), multiply(from_rpy(*turn.tolist()), before.orientation))
        goal.set_pose(wanted, is_turned=True)  # as a drag says
        now = until(lambda: goal.goal, lambda now, was=before: now.pose != was)
        assert now.problem is None
        assert now.jumped == ()
        reached = arm.fk(now.joints)
        assert reached.position == pytest.approx(wanted.position, abs=1e-4)
        assert turned_by(reached, wanted) < 0.05
    served.press("plan")
    until(lambda: served.operator.motions.plan, lambda plan: plan is not None)
    until(lambda: served.page.move.plan.content, lambda content: ENGLISH["duration"] in content)
    assert all(joint in served.page.move.plan.content for joint in arm.joint_names)
    served.press("execute")
    until(lambda: arm.pose().position, lambda at: at == pytest.approx(goal.goal.pose.position, abs=1e-3))
    rests(arm)
    assert turned_by(arm.pose(), goal.goal.pose) < 0.2


def test_a_jog_turns_the_tool_where_it_is_and_a_program_of_points_and_lines_runs(
    served: Served, arm: gemelo.Arm
) -> None:
    before = arm.pose()
    served.choose("along_axes", ENGLISH["tool_axes"])
    until(lambda: served.page.jog.frame_name, bool)
    served.holds("rz +", lambda: turned_by(arm.pose(), before) > 3.0)
    rests(arm)
    assert arm.pose().position == pytest.approx(before.position, abs=1e-3)
    served.choose("jog_mode", "10 mm / 10°")
    until(lambda: served.page.jog.step, lambda step: step == 10.0)
    turned = arm.pose()
    served.browser.press("ry -")
    until(lambda: turned_by(arm.pose(), turned), lambda by: by == pytest.approx(10.0, abs=0.2))
    rests(arm)
    assert arm.pose().position == pytest.approx(before.position, abs=2e-3)
    teaching = served.operator.teaching
    served.press("remember")
    until(lambda: list(teaching.points), bool)
    [name] = teaching.points
    arm.move(named="home")
    teaching.edit(Program("six", (Go(point=name), Line(offset=(0.0, 0.0, 0.03)))), is_saved=True)
    served.press("run_from")
    state = served.page.programs.state
    until(lambda: state.content, lambda content: ENGLISH["run_done"] in content, said=lambda: served.said)
    x, y, z = arm.fk(teaching.points[name].joints).position
    assert arm.pose().position == pytest.approx((x, y, z + 0.03), abs=2e-3)
