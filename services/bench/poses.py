"""Tool poses that inverse kinematics is measured on: those of random postures within the limits, so each can be met."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from services.arm.chain import link_transforms
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.arm.transforms import inverse, multiply
from services.bench.postures import random_postures
from services.planner.kinematics.ik import InverseKinematics
from services.planner.kinematics.targets import Target
from services.planner.request.deadline import NEVER

Array = NDArray[np.float64]

NEAR_ENOUGH = 1e-4  # [m]
TURNED_ENOUGH = 1e-3  # [rad]


@dataclass(frozen=True)
class Problem:
    """A target, the posture to be near to, and a posture that meets the target."""

    target: Target
    near: Array
    posture: Array


def problems(arm: Arm, kinematics: Kinematics, count: int, is_full: bool) -> list[Problem]:
    """Full poses, or positions alone; the same ones in every run."""
    postures = random_postures(arm, 2 * count)
    made = []
    for posture, near in zip(postures[:count], postures[count:], strict=True):
        pose = kinematics.tool(posture)
        made.append(Problem(Target(pose.position, pose.rotation if is_full else None), near, posture))
    return made


def solve(solver: InverseKinematics, problem: Problem) -> Array | None:
    """The first solution."""
    return next(solver.solutions(problem.target, problem.near, NEVER), None)


def is_solved(arm: Arm, problem: Problem, answer: Array | None) -> bool:
    """Whether the answer is within limits and the tool where it is to be, by kinematics other than the solver's."""
    if answer is None or not all(j.is_within(v) for j, v in zip(arm.joints, answer.tolist(), strict=True)):
        return False
    (x, y, z), got = tool_of(arm, answer)
    (a, b, c), wanted = tool_of(arm, problem.posture)
    if math.dist((x, y, z), (a, b, c)) > NEAR_ENOUGH:
        return False
    turn = multiply(inverse(((0.0, 0.0, 0.0), wanted))[1], got)
    return problem.target.rotation is None or 2.0 * math.hypot(*turn[:3]) <= TURNED_ENOUGH


def tool_of(arm: Arm, posture: Array) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """The tool in the base frame, by plain transforms."""
    return link_transforms(arm.model, dict(zip(arm.joint_names, posture.tolist(), strict=True)))[arm.tool_frame]


def solving_ms(solver: InverseKinematics, asked: list[Problem], tries: int) -> list[float]:
    """[ms] of every problem, the fastest of `tries`: other processes of this machine are not what is measured."""
    samples = []
    for problem in asked:
        took = []
        for _ in range(tries):
            started = time.perf_counter()
            solve(solver, problem)
            took.append((time.perf_counter() - started) * 1e3)
        samples.append(min(took))
    return samples
