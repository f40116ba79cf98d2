"""The references of the planner in the same run: the same arm and scene, other planners."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision.world import World
from gemelo.tools.bench.figures import NotMeasured
from gemelo.tools.bench.planner import references
from gemelo.tools.bench.planner.references import CoalChecker, PlainOmpl, Roboplan
from gemelo.tools.bench.problems.problem_sets import problem_set
from gemelo.tools.bench.scenes import SCENES, parol6, random_configurations, rm1

ARMS = {arm.name: arm for arm in (rm1(), parol6())}


@pytest.mark.parametrize("scene", list(SCENES))
@pytest.mark.parametrize("name", list(ARMS))
def test_all_are_asked_about_the_same_arm_in_the_same_scene(name: str, scene: str):
    arm = ARMS[name]
    ours = World(arm, Kinematics(arm), SCENES[scene])
    coal, roboplan = CoalChecker(arm, SCENES[scene]), Roboplan(arm, SCENES[scene])
    free = 0
    for configuration in random_configurations(arm, 300):
        is_free = ours.distance(configuration) > 0.0
        assert coal.is_free(configuration) is is_free
        assert roboplan.is_free(configuration) is is_free
        free += is_free
    assert 0 < free < 300


@pytest.mark.parametrize("kind", [PlainOmpl, Roboplan])
def test_a_reference_solves_what_can_be_solved(kind, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(references, "ALLOWED", 20.0)
    planner = kind(ARMS["rm1"], SCENES["cage"])
    problems = [problem for problem in problem_set("rm1", "cage").problems if problem.found_by != "straight"]
    for each in problems[:3]:
        answer = planner.shortened_path(each.start, each.goal, seed=1)
        assert answer is not None
        assert answer.took > 0.0
        assert answer.rows[[0, -1]] == pytest.approx(np.array((each.start, each.goal)))


@pytest.mark.parametrize("kind", [PlainOmpl, Roboplan])
def test_a_reference_says_where_it_finds_nothing(kind, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(references, "ALLOWED", 0.05)
    arm = ARMS["rm1"]
    planner, world = kind(arm, SCENES["cage"]), World(arm, Kinematics(arm), SCENES["cage"])
    touching = next(row for row in random_configurations(arm, 300) if world.distance(row) <= 0.0)
    start = problem_set("rm1", "cage").problems[0].start
    assert planner.shortened_path(start, tuple(touching.tolist()), seed=1) is None


def test_a_missing_reference_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "roboplan", None)
    with pytest.raises(NotMeasured, match="make setup"):
        Roboplan(ARMS["rm1"], SCENES["empty"])


@pytest.mark.parametrize("name", list(ARMS))
def test_configurations_are_drawn_from_the_whole_of_every_joint(name: str):
    joints = ARMS[name].joints
    rows = random_configurations(ARMS[name], 2000)
    travel = np.array([joint.upper - joint.lower for joint in joints])
    assert ((rows >= [joint.lower for joint in joints]) & (rows <= [joint.upper for joint in joints])).all()
    assert (np.ptp(rows, axis=0) > 0.99 * travel).all()
