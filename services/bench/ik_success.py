"""How many of 10,000 random reachable poses parol6 gets joint values for, within limits, to 0.1 mm and 1 mrad."""

from __future__ import annotations

from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, rounded
from services.bench.poses import is_solved, problems, solve
from services.planner.kinematics.ik import InverseKinematics

UNIT = "%"
GOAL = 99.9
POSES, SEARCHED = 10_000, 300


def measure() -> Figure:
    """parol6's share; the references are of the first of the same poses, in the same run."""
    arm = parol6()
    missed = POSES - solved(arm, POSES)
    share = 100.0 * (1.0 - missed / POSES)
    return Figure(
        unit=UNIT,
        median=share,
        p99=share,
        goal=f">= {GOAL:g}",
        met=share >= GOAL,
        reference={
            "parol6, searched": rounded(100.0 * solved(arm, SEARCHED, is_numeric=True) / SEARCHED),
            "rm1, position, searched": rounded(100.0 * solved(rm1(), SEARCHED, is_full=False) / SEARCHED),
        },
        note=f"{missed} of {POSES} poses of random postures missed; checked by plain transforms, not by the solver's",
    )


def solved(arm: Arm, count: int, is_full: bool = True, is_numeric: bool = False) -> int:
    """How many of so many random poses, or positions, are solved."""
    kinematics = Kinematics(arm)
    solver = InverseKinematics(arm, kinematics, is_numeric=is_numeric)
    asked = problems(arm, kinematics, count, is_full)
    return sum(is_solved(arm, problem, solve(solver, problem)) for problem in asked)
