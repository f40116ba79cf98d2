"""The planner's core keeps no more after many plans than after few."""

from __future__ import annotations

import gc
import tracemalloc
from random import Random

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest
from gemelo.services.planner.core import Planner

WARM_UP, PLANS = 40, 60
MOST = 20.0  # [B] a plan: less than one array of the smallest size


def test_a_plan_leaves_nothing_behind(rm1: ArmDescription):
    planner, random = Planner(rm1), Random(1)

    def place() -> tuple[float, ...]:
        return tuple(j.lower + random.uniform(0.2, 0.8) * (j.upper - j.lower) for j in rm1.joints)

    def plan() -> bool:
        start = JointState(name=rm1.joint_names, position=place())
        goal = JointGoal(name=rm1.joint_names, position=place())
        answer = planner.plan(PlanRequest(goal=goal, start=start, allowed_time=30.0), None)
        return answer.code is PlanCode.SUCCESS

    tracemalloc.start()
    try:
        assert sum(plan() for _ in range(WARM_UP)) > WARM_UP // 2
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(PLANS):
            plan()
        gc.collect()
        assert tracemalloc.get_traced_memory()[0] - before < MOST * PLANS
    finally:
        tracemalloc.stop()
