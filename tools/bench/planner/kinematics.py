"""Figures of inverse kinematics, time and success, on the tool poses of random configurations: each is reachable."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import inverse, multiply
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.scenes import parol6, random_configurations, rm1

Array = NDArray[np.float64]

GOAL = FigureGoal(median=0.2, p99=1.0)  # [ms]
SUCCESS_GOAL = 99.9  # [%]
POSES, SEARCHED, TRIES = 2000, 200, 3
SUCCESS_POSES, SUCCESS_SEARCHED = 10_000, 300
NEAR_ENOUGH = 1e-4  # [m]
TURNED_ENOUGH = 1e-3  # [rad]


@dataclass(frozen=True)
class ToolProblem:
    """A target for the tool."""

    target: ToolTarget
    near: Array  # (n,) the seed: the nearest solution is wanted
    solution: Array  # (n,) one configuration that meets the target


def ik_ms() -> Figure:
    """Time of one full tool pose [ms]: parol6 in closed form; the references search for the first of the same poses."""
    arm = parol6()
    kinematics = Kinematics(arm)
    solver = InverseKinematics(arm, kinematics)
    if not solver.is_closed_form:
        raise NotMeasured("EAIK could not be imported")
    problems = random_problems(arm, kinematics, POSES, is_full=True)
    searched = solving_ms(InverseKinematics(arm, kinematics, is_numeric=True), problems[:SEARCHED], TRIES)
    short = rm1()
    short_kinematics = Kinematics(short)
    positions = random_problems(short, short_kinematics, SEARCHED, is_full=False)
    short_ms = solving_ms(InverseKinematics(short, short_kinematics), positions, TRIES)
    reference = {
        "parol6, searched, median": quantile(searched, 0.5),
        "parol6, searched, p99": quantile(searched, 0.99),
        "rm1, position, searched, median": quantile(short_ms, 0.5),
        "rm1, position, searched, p99": quantile(short_ms, 0.99),
    }
    note = f"{POSES} random reachable poses, each from a random configuration, the fastest of {TRIES} runs of each"
    return of_samples(solving_ms(solver, problems, TRIES), GOAL, reference, note)


def ik_success() -> Figure:
    """Share [%] of 10,000 random reachable poses that parol6 solves within limits, to 0.1 mm and 1 mrad."""
    arm = parol6()
    missed = SUCCESS_POSES - solved(arm, SUCCESS_POSES)
    share = 100.0 * (1.0 - missed / SUCCESS_POSES)
    searched = solved(arm, SUCCESS_SEARCHED, is_numeric=True)
    positions = solved(rm1(), SUCCESS_SEARCHED, is_full=False)
    return Figure(
        median=share,
        p99=share,
        goal=f">= {SUCCESS_GOAL:g}",
        met=share >= SUCCESS_GOAL,
        reference={
            "parol6, searched": rounded(100.0 * searched / SUCCESS_SEARCHED),
            "rm1, position, searched": rounded(100.0 * positions / SUCCESS_SEARCHED),
        },
        note=(
            f"{missed} of {SUCCESS_POSES} poses of random configurations missed; checked by plain transforms, not by "
            "the solver's"
        ),
    )


def random_problems(arm: ArmDescription, kinematics: Kinematics, count: int, is_full: bool) -> list[ToolProblem]:
    """Full poses, or positions alone; the same ones in every run."""
    rows = random_configurations(arm, 2 * count)
    made = []
    for solution, near in zip(rows[:count], rows[count:], strict=True):
        pose = kinematics.tool(solution)
        made.append(ToolProblem(ToolTarget(pose.position, pose.rotation if is_full else None), near, solution))
    return made


def solve(solver: InverseKinematics, problem: ToolProblem) -> Array | None:
    """The first solution (n,) [rad] or [m]; None if there is none."""
    return next(solver.solutions(problem.target, problem.near, NEVER), None)


def solving_ms(solver: InverseKinematics, problems: list[ToolProblem], tries: int) -> list[float]:
    """Time [ms] of every problem: the fastest of `tries`, because other processes are not to be measured."""
    samples = []
    for problem in problems:
        took = []
        for _ in range(tries):
            started = time.perf_counter()
            solve(solver, problem)
            took.append((time.perf_counter() - started) * 1e3)
        samples.append(min(took))
    return samples


def solved(arm: ArmDescription, count: int, is_full: bool = True, is_numeric: bool = False) -> int:
    """Number of solved problems among `count` random ones."""
    kinematics = Kinematics(arm)
    solver = InverseKinematics(arm, kinematics, is_numeric=is_numeric)
    problems = random_problems(arm, kinematics, count, is_full)
    return sum(is_solved(arm, problem, solve(solver, problem)) for problem in problems)


def is_solved(arm: ArmDescription, problem: ToolProblem, answer: Array | None) -> bool:
    """True if `answer` (n,) [rad] or [m] is within limits and meets the target, by kinematics other than the
    solver's."""
    if answer is None or not all(j.is_within(v) for j, v in zip(arm.joints, answer.tolist(), strict=True)):
        return False
    (x, y, z), reached = tool_of(arm, answer)
    (a, b, c), wanted = tool_of(arm, problem.solution)
    if math.dist((x, y, z), (a, b, c)) > NEAR_ENOUGH:
        return False
    turn = multiply(inverse(((0.0, 0.0, 0.0), wanted))[1], reached)
    return problem.target.rotation is None or 2.0 * math.hypot(*turn[:3]) <= TURNED_ENOUGH


def tool_of(
    arm: ArmDescription, positions: Array
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Position [m] and quaternion (x, y, z, w) of the tool in the base frame, by plain transforms."""
    return link_transforms(arm.model, dict(zip(arm.joint_names, positions.tolist(), strict=True)))[arm.tool_frame]
