"""What `ik_ms` and `ik_success` count as solved."""

from __future__ import annotations

import numpy as np
import pytest

from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.main import NAMES, module_of
from services.bench.poses import is_solved, problems, solve
from services.planner.kinematics.ik import InverseKinematics
from services.planner.request.deadline import NEVER


@pytest.mark.parametrize("name", ["ik_ms", "ik_success"])
def test_both_figures_are_measured(name: str):
    assert name in NAMES
    assert callable(module_of(name).measure)


def test_a_solution_counts_and_what_is_off_does_not():
    arm = parol6()
    kinematics = Kinematics(arm)
    [problem] = problems(arm, kinematics, 1, is_full=True)
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
    [problem] = problems(arm, Kinematics(arm), 1, is_full=False)
    other = InverseKinematics(arm, Kinematics(arm)).solutions(problem.target, -problem.posture, NEVER)
    assert all(is_solved(arm, problem, answer) for answer in other)
