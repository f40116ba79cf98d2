"""A line of the tool, from request to verified trajectory, in the planner's own core, on fixed random problems."""

from __future__ import annotations

import time

import numpy as np

from schemas.joints import JointState
from schemas.planning import LinearMotion, PlanCode, PlanRequest, PoseGoal
from services.arm.description import Arm
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, of_samples, quantile
from services.bench.plain_lines import PlainLines
from services.planner.core import Planner

UNIT = "ms"
PROBLEMS = 200  # an arm
SEED = 5
LONGEST = 0.2  # [m]
COMFORT = 0.2  # share of the joints' travel at both ends in which no line begins
WARMING = 5


def measure() -> Figure:
    samples: list[float] = []
    reference: dict[str, float] = {}
    told: list[str] = []
    for arm in (rm1(), parol6()):
        took, fractions = lines(arm)
        samples += took
        reference[f"{arm.name} median"] = quantile(took, 0.5)
        reference[f"{arm.name} p99"] = quantile(took, 0.99)
        line = PlainLines(arm)
        plain = [line.solving_ms(request) for request in problems(arm, Planner(arm))][WARMING:]
        reference[f"{arm.name}, plain way, median"] = quantile(plain, 0.5)
        reference[f"{arm.name}, plain way, p99"] = quantile(plain, 0.99)
        told.append(f"{arm.name} {sum(fraction == 1.0 for fraction in fractions)} whole")
    note = (
        f"{PROBLEMS} random lines an arm of up to {LONGEST} m (seed {SEED}), no obstacles but the arm itself; "
        f"{', '.join(told)}, the others go as far as a limit, a singularity or a contact lets them, and count; the "
        "plain way is a posture every 5 mm and toppra, neither looked at in between nor verified"
    )
    return of_samples(samples, UNIT, reference=reference, note=note)


def lines(arm: Arm) -> tuple[list[float], list[float]]:
    """Times [ms] of the plans, and the fractions of their lines; 0 for one that could not be begun."""
    planner = Planner(arm)
    took: list[float] = []
    fractions: list[float] = []
    for index, request in enumerate(problems(arm, planner)):
        began = time.perf_counter()
        answer = planner.plan(request, None)
        if index >= WARMING:
            took.append((time.perf_counter() - began) * 1e3)
            fractions.append(answer.fraction if answer.code is PlanCode.SUCCESS else 0.0)
    return took, fractions


def problems(arm: Arm, planner: Planner) -> list[PlanRequest]:
    """Random starts and directions; the same ones in every run."""
    random = np.random.default_rng(SEED)
    lower = np.array([joint.lower for joint in arm.joints])
    travel = np.array([joint.upper for joint in arm.joints]) - lower
    requests: list[PlanRequest] = []
    while len(requests) < PROBLEMS + WARMING:
        start = lower + random.uniform(COMFORT, 1.0 - COMFORT, len(lower)) * travel
        way = random.normal(size=3)
        way *= random.uniform(0.01, LONGEST) / np.linalg.norm(way)
        if planner.kinematics.self_collisions(start, 0.01):
            continue
        goal = planner.kinematics.tool(start).position + way
        standing = JointState(name=arm.joint_names, position=tuple(start.tolist()))
        motion = LinearMotion(least_fraction=0.0)
        requests.append(PlanRequest(goal=PoseGoal(position=tuple(goal.tolist())), start=standing, motion=motion))
    return requests
