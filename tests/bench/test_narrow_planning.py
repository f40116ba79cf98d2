"""The narrow problems of arms that do not ship, and the figure about them on a few."""

from __future__ import annotations

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.tools.bench.any_arm.drawn_problems import problems
from gemelo.tools.bench.any_arm.generated_arms import RAIL, generated_arm
from gemelo.tools.bench.any_arm.narrow_families import HAND, NARROW, PLAY
from gemelo.tools.bench.planner import narrow_planning

FEW = 2


def test_the_arm_on_a_rail_is_the_one_of_seven_joints_carried_along_y():
    seven, eight = Kinematics(generated_arm("seven")), Kinematics(generated_arm("eight"))
    arm = generated_arm("eight")
    assert arm.joints[0].upper == RAIL
    for row in np.random.default_rng(0).uniform(-1.0, 0.0, (20, 8)):
        fixed, moved = seven.tool(row[1:]), eight.tool(row)
        assert np.allclose(moved.position, fixed.position + np.array((0.0, row[0], 0.0)), atol=1e-9)
        assert np.allclose(moved.rotation, fixed.rotation, atol=1e-9)


@pytest.mark.parametrize("family", NARROW)
@pytest.mark.parametrize("name", narrow_planning.ARMS)
def test_both_ends_are_free_and_a_little_way_off_something_is_touched(name: str, family: str):
    arm = generated_arm(name)
    kinematics = Kinematics(arm)
    for problem in problems(arm, kinematics, family, FEW, NARROW):
        world = World(arm, kinematics, problem.setting.scene)
        for configuration in (problem.start, problem.goal):
            assert CLEARANCE < world.distance(configuration) < 0.5 * (HAND + PLAY)


def test_the_figure_is_of_all_that_any_planner_solves(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(narrow_planning, "ARMS", ("seven",))
    monkeypatch.setattr(narrow_planning, "NARROW", {"tight shelves": NARROW["tight shelves"]})
    figure = narrow_planning.plan_narrow_ms(FEW)
    assert figure.median is not None
    assert figure.p99 is not None
    assert 0.0 < figure.median <= figure.p99
    assert (figure.reference["solved %"], figure.reference["contacts"]) == (100.0, 0.0)
    assert figure.reference["of roboplan's, p50"] > 0.0
    assert "not solved: none; 0 more" in figure.note
