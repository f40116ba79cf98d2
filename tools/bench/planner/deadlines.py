"""The figure of plans that cannot be made in the time they are allowed: how much later their answers leave."""

from __future__ import annotations

import gc
import time
from itertools import product

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JointGoal, PlanCode, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples, quantile
from gemelo.tools.bench.planner.mesh_planning import dented_ball
from gemelo.tools.bench.scenes import rm1

ALLOWED = (0.1, 0.3)  # [s]
PLANNERS = ("native", "RRTConnect", "PRM", "")
SEEDS = 4
START, BEYOND = (0.0, 0.3, 0.05), (1.2, 0.3, 0.05)  # of rm1, on both sides of a wall that it cannot turn past
GOAL = FigureGoal(p99=100.0)  # [ms]


def deadline_overrun_ms() -> Figure:
    """Time of the CPU [ms] beyond the allowed time until the refusal of a plan to which there is no way."""
    late: list[float] = []
    shares: list[float] = []
    arm = rm1()
    for with_mesh in (False, True):
        planner = walled(arm, with_mesh)
        gc.freeze()  # as the planner's workers do
        for allowed, planner_id, seed in product(ALLOWED, PLANNERS, range(SEEDS)):
            took = spent(planner, hopeless(arm, allowed, planner_id, seed))
            late.append(1e3 * max(0.0, took - allowed))
            shares.append(took / allowed)
        gc.unfreeze()
    reference = {"of the time allowed, median": quantile(shares, 0.5), "p99": quantile(shares, 0.99)}
    note = (
        f"rm1 between two walls, with and without a rock of 100,000 triangles, {len(late)} plans by "
        f"{len(PLANNERS)} searches, allowed {ALLOWED[0]:g} and {ALLOWED[1]:g} s"
    )
    return of_samples(late, GOAL, reference, note)


def walled(arm: ArmDescription, with_mesh: bool) -> Planner:
    """A planner that is ready, in the scene."""
    objects = [wall("left wall", 0.6), wall("right wall", -1.6)]
    planner = Planner(arm)
    scene = PlanningScene(version=1, objects=(*objects, dented_ball()) if with_mesh else tuple(objects))
    planner.set_world(World(arm, planner.kinematics, scene))
    planner.prepare()
    return planner


def wall(name: str, angle: float) -> SceneObject:
    """From the column outwards, at `angle` [rad]."""
    place = (0.55 * float(np.cos(angle)), 0.55 * float(np.sin(angle)), 0.0)
    turn = (0.0, 0.0, float(np.sin(angle / 2)), float(np.cos(angle / 2)))
    return SceneObject(
        name=name, shape=BoxShape(size=(0.9, 0.02, 3.0)), pose=Transform(translation=place, rotation=turn)
    )


def hopeless(arm: ArmDescription, allowed: float, planner_id: str, seed: int) -> PlanRequest:
    """A plan past the wall in `allowed` [s]."""
    return PlanRequest(
        start=JointState(name=arm.joint_names, position=START),
        goal=JointGoal(name=arm.joint_names, position=BEYOND),
        motion=FreeMotion(planner_id=planner_id, seed=seed),
        allowed_time=allowed,
    )


def spent(planner: Planner, request: PlanRequest) -> float:
    """[s] of the CPU until the answer, by which the planner counts its time as well."""
    began = time.process_time()
    response = planner.plan(request, None, clock=time.process_time)
    if response.code is PlanCode.SUCCESS:
        raise AssertionError("there is no way past the wall")
    return time.process_time() - began
