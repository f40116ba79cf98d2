"""The fixed problems that plans are measured on."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.tools.bench.problems.problem_sets import (
    COUNT,
    FILE,
    PlanningProblem,
    ProblemSet,
    path_length,
    problem_set,
    problem_sets,
    request_of,
    text_of,
)
from gemelo.tools.bench.scenes import SCENES, parol6, rm1

ARMS = {arm.name: arm for arm in (rm1(), parol6())}
KINEMATICS = {name: Kinematics(arm) for name, arm in ARMS.items()}


@pytest.fixture(params=[(arm, scene) for arm in ARMS for scene in SCENES], ids=lambda pair: " ".join(pair))
def each(request) -> ProblemSet:
    return problem_set(*request.param)


def test_every_scene_has_two_hundred_problems_for_both_arms_half_of_them_poses(each: ProblemSet):
    assert COUNT >= 200
    assert len(set(each.problems)) == len(each.problems) == COUNT
    assert sum(problem.is_pose for problem in each.problems) == COUNT // 2
    assert each.drawn >= COUNT


def test_both_ends_are_within_limits_and_free(each: ProblemSet):
    arm = ARMS[each.arm]
    world = World(arm, KINEMATICS[each.arm], SCENES[each.scene])
    for problem in each.problems:
        for configuration in (problem.start, problem.goal):
            assert all(joint.is_within(value) for joint, value in zip(arm.joints, configuration, strict=True))
            assert world.distance(configuration) > CLEARANCE


def test_no_known_path_is_shorter_than_the_straight_line(each: ProblemSet):
    speeds = np.array([joint.velocity for joint in ARMS[each.arm].joints])
    for problem in each.problems:
        straight = path_length(np.array([problem.start, problem.goal]), speeds)
        if not problem.is_pose:
            assert problem.length >= straight - 1e-4
            if problem.found_by == "straight":
                assert problem.length == pytest.approx(straight, abs=1e-4)
        assert problem.length > 0.0


def test_the_file_is_as_it_is_written():
    assert text_of(problem_sets()) == FILE.read_text()


def test_what_is_written_is_what_is_read():
    sets = (
        ProblemSet("one", "empty", 3, (PlanningProblem((0.1,), (0.2,), True, 0.5, "native"),)),
        ProblemSet("other", "full", 0, ()),
    )
    assert msgspec.json.decode(text_of(sets), type=tuple[ProblemSet, ...]) == sets


def test_a_pose_is_asked_for_where_the_arm_can_choose_it():
    for name, turns in (("rm1", False), ("parol6", True)):
        problem = next(each for each in problem_set(name, "empty").problems if each.is_pose)
        goal = request_of(problem, ARMS[name], KINEMATICS[name]).goal
        assert goal.position == pytest.approx(KINEMATICS[name].tool(problem.goal).position.tolist())
        assert bool(goal.orientation) is turns


def test_a_length_is_the_time_at_full_speed():
    rows = np.array([[0.0, 0.0], [3.0, 8.0], [3.0, 10.0]])
    assert path_length(rows, np.array([1.0, 2.0])) == pytest.approx(5.0 + 1.0)
