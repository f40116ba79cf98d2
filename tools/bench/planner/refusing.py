"""The figure of plans that cannot be made, and how soon the planner says so."""

from __future__ import annotations

import time
from collections.abc import Iterator

import msgspec

from gemelo.schemas.planning import PlanCode, PlanRequest, PoseGoal
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.any_arm.drawn_problems import DrawnProblem, ProblemDrawer
from gemelo.tools.bench.any_arm.families import FAMILIES
from gemelo.tools.bench.any_arm.generated_arms import ARMS, generated_arm
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples
from gemelo.tools.bench.planner.trials import WARMING, spread
from gemelo.tools.bench.problems.problem_sets import tool_pose

BEYOND = 3.0  # times as far from the base as the drawn pose: no arm of these reaches so far
GOAL = FigureGoal(median=10.0, p99=100.0)  # [ms]
Asked = tuple[str, DrawnProblem, PlanRequest, PlanCode]


def refusal_ms(count: int) -> Figure:
    """CPU time [ms] from a request that cannot be fulfilled to its refusal, of the first `count` problems of each arm
    and family: the goal touches something, is too near to something, or is out of reach."""
    took: dict[str, list[float]] = {}
    for arm in ARMS:
        planner = Planner(generated_arm(arm))
        planner.prepare()
        asked = list(_asked(planner, count))
        for what, problem, request, code in (*asked[:WARMING], *asked):
            planner.set_world(World(planner.arm, planner.kinematics, problem.setting.scene))
            planner.prepare()
            began = time.process_time()
            response = planner.plan(request, None, clock=time.process_time)
            took.setdefault(what, []).append(1e3 * (time.process_time() - began))
            if response.code is not code:
                raise AssertionError(f"{arm} {problem.family} {problem.seed}, {what}: {response.code}")
    reference: dict[str, float] = {}
    for what, some in took.items():
        reference |= spread(what, some, 0.5, 0.99)
    note = f"{', '.join(ARMS)}, {len(FAMILIES)} families; a search that ends with its time is in deadline_overrun_ms"
    return of_samples([each for some in took.values() for each in some], GOAL, reference, note)


def _asked(planner: Planner, count: int) -> Iterator[Asked]:
    arm, kinematics, drawer = planner.arm, planner.kinematics, ProblemDrawer(planner.arm, planner.kinematics)
    for family in FAMILIES:
        for seed in range(count):
            touching, near = drawer.in_contact(family, seed), drawer.near(family, seed)
            joints = msgspec.structs.replace(touching.request(arm, kinematics), goal=touching.joint_goal(arm))
            yield "goal in contact", touching, joints, PlanCode.GOAL_IN_COLLISION
            joints = msgspec.structs.replace(near.request(arm, kinematics), goal=near.joint_goal(arm), clearance=None)
            yield "goal too near", near, joints, PlanCode.GOAL_IN_COLLISION
            pose = tool_pose(arm, kinematics, near.start)
            far = PoseGoal(position=tuple(BEYOND * value for value in pose.position), orientation=pose.orientation)
            yield "out of reach", near, msgspec.structs.replace(joints, goal=far), PlanCode.NO_IK_SOLUTION
