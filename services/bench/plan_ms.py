"""One plan, from request to verified trajectory, in the planner's own core, on fixed random problems in four scenes."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass

import numpy as np

from schemas.joints import JointState
from schemas.planning import FreeMotion, JointGoal, PlanningTimes, PlanRequest, PlanResponse, PoseGoal
from services.arm.description import Arm
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, Goal, of_samples, quantile
from services.bench.plan_scenes import SCENES
from services.planner.core import Planner
from services.planner.goals.goals import Goals
from services.planner.scene.clearance import CLEARANCE
from services.planner.scene.world import World
from services.planner.search.ompl_search import ompl_corners
from services.planner.search.validity import Validity
from services.planner.search.way import Deadline, NoWay

UNIT = "ms"
GOAL = Goal(median=2.0, p99=20.0)
PROBLEMS = 50  # a scene and arm
ALLOWED = 1.0  # [s]
SEED = 2
PHASES = PlanningTimes.__struct_fields__


@dataclass(frozen=True)
class Trial:
    """One problem: how long it took, of the clock and of the CPU [ms], what came out, and [ms] of the reference."""

    took: float
    worked: float
    response: PlanResponse
    reference: float | None = None

    @property
    def is_solved(self) -> bool:
        return self.response.refusal is None

    @property
    def is_searched(self) -> bool:
        return self.is_solved and self.response.planner_id != "straight"


def measure() -> Figure:
    """Of the solved problems; those that neither the planner nor the reference solves in time are counted apart."""
    by_scene: dict[str, list[Trial]] = {}
    for arm in (rm1(), parol6()):
        planner = Planner(arm)
        planner.prepare()
        for name in SCENES:
            by_scene[f"{arm.name} {name}"] = trials(planner, name)
    every = [trial for some in by_scene.values() for trial in some]
    solved = [trial for trial in every if trial.is_solved]
    solvable = [trial for trial in every if trial.is_solved or trial.reference is not None]
    searched = [trial for trial in solved if trial.is_searched]
    reference = {f"{name}, p50": _median([t.took for t in some if t.is_solved]) for name, some in by_scene.items()}
    reference |= {f"{phase}, p50 of those searched": _phase(searched, phase) for phase in PHASES}
    reference |= {
        "straight lines, p50": _median([t.took for t in solved if not t.is_searched]),
        "searched, p50": _median([t.took for t in searched]),
        "straight lines, p50 of the CPU time": _median([t.worked for t in solved if not t.is_searched]),
        "searched, p50 of the CPU time": _median([t.worked for t in searched]),
        "searched, p99": quantile([t.took for t in searched], 0.99) if searched else 0.0,
        "solved of the solvable, %": 100.0 * len(solved) / len(solvable),
        "OMPL RRTConnect on coal, search alone, p50": _median([t.reference for t in every if t.reference is not None]),
        "our search, p50 of those searched": _phase(searched, "search"),
    }
    note = (
        f"rm1 and parol6, {len(SCENES)} scenes, {PROBLEMS} random problems each (postures and tool poses in turns, "
        f"seed {SEED}), {ALLOWED:g} s allowed; {len(searched)} needed a search; of {len(every)} nothing here found a "
        f"way for {len(every) - len(solvable)}"
    )
    return of_samples([trial.took for trial in solved], UNIT, GOAL, reference, note)


def trials(planner: Planner, name: str) -> list[Trial]:
    """The problems of one scene, after two that warm the caches."""
    world = World(planner.arm, planner.kinematics, SCENES[name])
    planner.set_world(world)
    random_ = random.Random(SEED)
    return [trial(planner, world, random_, index) for index in range(-2, PROBLEMS)][2:]


def trial(planner: Planner, world: World, random_: random.Random, index: int) -> Trial:
    arm = planner.arm
    start, goal = free_posture(arm, world, random_), free_posture(arm, world, random_)
    asked = JointGoal(name=arm.joint_names, position=goal) if index % 2 else tool_pose(planner, goal)
    request = PlanRequest(
        goal=asked, start=JointState(name=arm.joint_names, position=start), allowed_time=ALLOWED, motion=FreeMotion()
    )
    began, before = time.perf_counter(), time.process_time()
    response = planner.plan(request, None, clock=time.perf_counter)
    took, worked = (time.perf_counter() - began) * 1e3, (time.process_time() - before) * 1e3
    needs_search = response.refusal is not None or response.planner_id != "straight"
    return Trial(took, worked, response, coal_ms(planner, world, request, start) if needs_search else None)


def coal_ms(planner: Planner, world: World, request: PlanRequest, start: tuple[float, ...]) -> float | None:
    """[ms] that plain RRTConnect takes with the checker on coal, None where it finds nothing in time."""
    began = time.perf_counter()
    deadline = Deadline(time.perf_counter, ALLOWED, began)
    postures = Goals(planner.arm, planner.kinematics, planner.surroundings).candidates(
        request.goal, start, deadline.is_late
    )
    goals = [goal for goal in postures if world.distance(goal) > CLEARANCE][:8]
    if not goals:
        return None
    began = time.perf_counter()
    validity = Validity(world, CLEARANCE)
    try:
        ompl_corners(
            planner.arm,
            "RRTConnect",
            np.array(start),
            np.array(goals),
            validity,
            SEED,
            Deadline(time.perf_counter, ALLOWED, began),
        )
    except NoWay:
        return None
    return (time.perf_counter() - began) * 1e3


def free_posture(arm: Arm, world: World, random_: random.Random) -> tuple[float, ...]:
    """Random joint values within the limits at which nothing is nearer than the clearance."""
    while True:
        posture = tuple(random_.uniform(joint.lower, joint.upper) for joint in arm.joints)
        if world.distance(posture) > CLEARANCE:
            return posture


def tool_pose(planner: Planner, posture: tuple[float, ...]) -> PoseGoal:
    """Where the tool is in that posture, and how it is turned, for arms that can choose it."""
    pose = planner.kinematics.link_poses(posture)[planner.arm.tool_frame]
    if len(planner.arm.joints) < 6:
        return PoseGoal(position=pose.translation)
    return PoseGoal(position=pose.translation, orientation=pose.rotation)


def _phase(trials: list[Trial], phase: str) -> float:
    return _median([1e3 * float(getattr(trial.response.times, phase)) for trial in trials])


def _median(values: list[float]) -> float:
    return quantile(values, 0.5) if values else 0.0
