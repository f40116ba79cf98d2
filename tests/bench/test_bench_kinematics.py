"""The condition under which `ik_ms` and `ik_success` count a pose as solved."""

from __future__ import annotations

import numpy as np

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.request.deadline import NEVER
from gemelo.tools.bench.planner.kinematics import is_solved, random_problems, solve
from gemelo.tools.bench.scenes import parol6, rm1


def test_a_solution_counts_and_what_is_off_does_not():
    arm = parol6()
    kinematics = Kinematics(arm)
    [problem] = random_problems(arm, kinematics, 1, is_full=True)
    answer = solve(InverseKinematics(arm, kinematics), problem)
    assert answer is not None
    assert is_solved(arm, problem, answer)
    assert not is_solved(arm, problem, None)
    assert not is_solved(arm, problem, answer + 0.002)
    assert not is_solved(arm, problem, answer + 2.0 * np.pi)  # the same pose, beyond the limits
    tilted = answer + np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.002])
    assert not is_solved(arm, problem, tilted)


def test_of_a_position_the_orientation_does_not_count():
    arm = rm1()
    [problem] = random_problems(arm, Kinematics(arm), 1, is_full=False)
    other = InverseKinematics(arm, Kinematics(arm)).solutions(problem.target, -problem.solution, NEVER)
    assert all(is_solved(arm, problem, answer) for answer in other)
