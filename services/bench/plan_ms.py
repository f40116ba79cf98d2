"""One plan, from request to verified trajectory, in the planner's own core, on fixed random problems."""

from __future__ import annotations

import random
import time

from schemas.joints import JointState
from schemas.planning import JointGoal, PlanRequest, PoseGoal
from services.arm.description import Arm
from services.bench.arms import rm1
from services.bench.figure import Figure, Goal, of_samples
from services.planner.core import Planner

UNIT = "ms"
GOAL = Goal(median=2.0, p99=20.0)
PROBLEMS = 400
SEED = 2


def measure() -> Figure:
    arm = rm1()
    planner = Planner(arm)
    samples, refused = [], 0
    for index, request in enumerate(problems(arm, planner)):
        started = time.perf_counter()
        answer = planner.plan(request, None)
        took = (time.perf_counter() - started) * 1e3
        refused += answer.refusal is not None
        if index >= 10:  # the first ones warm the caches
            samples.append(took)
    note = (
        f"rm1, {len(samples)} random problems (tool positions and joint goals in turns, seed {SEED}), no obstacles: "
        f"they are not in this planner yet; {refused} were refused with a reason, and count"
    )
    return of_samples(samples, UNIT, GOAL, note=note)


def problems(arm: Arm, planner: Planner) -> list[PlanRequest]:
    """Random starts, and goals that the joints can reach; the same ones in every run."""
    random_ = random.Random(SEED)
    requests = []
    for index in range(PROBLEMS + 10):
        start = JointState(name=arm.joint_names, position=somewhere(arm, random_))
        goal = somewhere(arm, random_)
        tool = tuple(planner.kinematics.tool(goal).position.tolist())
        asked = PoseGoal(position=tool) if index % 2 else JointGoal(name=arm.joint_names, position=goal)
        requests.append(PlanRequest(goal=asked, start=start))
    return requests


def somewhere(arm: Arm, random_: random.Random) -> tuple[float, ...]:
    """Random joint values within the limits."""
    return tuple(random_.uniform(joint.lower, joint.upper) for joint in arm.joints)
