"""Problems of an arm in a family, drawn by seed: a scene, two free configurations in it, and how the goal is asked for.

Nobody knows beforehand whether a way leads from one to the other: what counts as possible is what any planner solves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.targets import ToolTarget
from gemelo.services.planner.request.deadline import NEVER
from gemelo.tools.bench.any_arm.families import FAMILIES, Family, Setting, ToolPose, settings
from gemelo.tools.bench.problems.problem_sets import ALLOWED, tool_pose

Array = NDArray[np.float64]

COUNT = 100  # problems of an arm in a family
SPARE = 0.002  # [m] beyond the clearance that both ends keep
TRIES = 30  # random configurations for one end, before another scene is drawn
SOLUTIONS = 6  # of one pose that are looked at
NEAREST, FARTHEST = 0.0008, 0.0039  # [m] that goals near things are away from something
NARROW = 0.0005  # [m] of clearance that is asked for there
HALVINGS = 40
REVOLUTION = np.pi  # [rad] either way, where a joint can do more: nobody winds it up for one move


@dataclass(frozen=True)
class DrawnProblem:
    """From rest to rest, (n,) [rad] each; with `is_pose` the tool's pose at the goal is asked for."""

    arm: str
    family: str
    seed: int
    setting: Setting
    start: tuple[float, ...]
    goal: tuple[float, ...]
    is_pose: bool
    clearance: float | None = None  # [m] that is asked for; None: the arm's own

    def joint_goal(self, arm: ArmDescription) -> JointGoal:
        """The goal by its joint values."""
        return JointGoal(name=arm.joint_names, position=self.goal)

    def request(self, arm: ArmDescription, kinematics: Kinematics, allowed: float = ALLOWED) -> PlanRequest:
        """What a client sends, with `allowed` [s] for it."""
        names = arm.joint_names
        return PlanRequest(
            goal=tool_pose(arm, kinematics, self.goal) if self.is_pose else self.joint_goal(arm),
            start=JointState(name=names, position=self.start),
            allowed_time=allowed,
            clearance=self.clearance,
        )


class ProblemDrawer:
    """Draws problems for one arm."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, families: Mapping[str, Family] = FAMILIES) -> None:
        self._arm, self._kinematics, self._families = arm, kinematics, families
        self._ik = InverseKinematics(arm, kinematics)
        lower, upper = np.array([(joint.lower, joint.upper) for joint in arm.joints]).T
        self._lower, self._upper = np.maximum(lower, -REVOLUTION), np.minimum(upper, REVOLUTION)

    def problem(self, family: str, seed: int) -> DrawnProblem:
        """The problem of this seed: the same one in every run. Every other one asks for a pose."""
        random = np.random.default_rng((list(self._families).index(family), seed, len(self._arm.joints)))
        for setting in settings(family, seed, self._families):
            world = World(self._arm, self._kinematics, setting.scene)
            goal = self._end(world, setting.goal, random)
            start = None if goal is None else self._end(world, setting.start, random)
            if start is not None and goal is not None and start != goal:
                return DrawnProblem(self._arm.name, family, seed, setting, start, goal, seed % 2 == 0)
        raise AssertionError("settings do not end")

    def near(self, family: str, seed: int) -> DrawnProblem:
        """As `problem`, with the goal moved to where the arm is only `NEAREST` to `FARTHEST` from something."""
        free = self.problem(family, seed)
        world = World(self._arm, self._kinematics, free.setting.scene)
        random = np.random.default_rng((seed, list(FAMILIES).index(family)))
        while True:
            wanted = random.uniform(NEAREST, FARTHEST)
            row = self._brought_near(world, np.array(free.goal), random.uniform(self._lower, self._upper), wanted)
            if row is not None:
                return replace(free, goal=tuple(row.tolist()), clearance=NARROW)

    def in_contact(self, family: str, seed: int) -> DrawnProblem:
        """As `problem`, with a goal at which links touch something."""
        free = self.problem(family, seed)
        world = World(self._arm, self._kinematics, free.setting.scene)
        random = np.random.default_rng((seed, list(FAMILIES).index(family)))
        while True:
            row = random.uniform(self._lower, self._upper)
            if world.distance(row) <= 0.0:
                return replace(free, goal=tuple(row.tolist()))

    def _brought_near(self, world: World, free: Array, other: Array, wanted: float) -> Array | None:
        """A place on the straight line to the `other` configuration (n,) [rad] that is `wanted` [m] from something, or
        a little more; None where the other touches nothing, or the tolerance is not met."""
        if world.distance(other) > 0.0:
            return None
        low, high = 0.0, 1.0
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            is_far = world.distance(free + middle * (other - free)) >= wanted
            low, high = (middle, high) if is_far else (low, middle)
        row: Array = np.round(free + low * (other - free), 6)
        return row if NEAREST <= world.distance(row) <= FARTHEST else None

    def _end(self, world: World, pose: ToolPose | None, random: np.random.Generator) -> tuple[float, ...] | None:
        """A free configuration (n,) [rad], with the tool at `pose` where there is one; None where none is found."""
        for near in random.uniform(self._lower, self._upper, (TRIES if pose is None else 2, len(self._lower))):
            rows = [near] if pose is None else self._solutions(pose, near)
            for row in rows:
                if self._is_usable(row) and world.distance(row) > world.clearance + SPARE:
                    return tuple(row.tolist())
        return None

    def _solutions(self, pose: ToolPose, near: Array) -> list[Array]:
        found = self._ik.solutions(ToolTarget(pose.position, pose.rotation), near, NEVER)
        return [np.round(row, 6) for row in islice(found, SOLUTIONS)]

    def _is_usable(self, row: Array) -> bool:
        return bool((row >= self._lower).all() and (row <= self._upper).all())


def problems(
    arm: ArmDescription,
    kinematics: Kinematics,
    family: str,
    count: int = COUNT,
    families: Mapping[str, Family] = FAMILIES,
) -> list[DrawnProblem]:
    """The first `count` problems of a family."""
    drawer = ProblemDrawer(arm, kinematics, families)
    return [drawer.problem(family, seed) for seed in range(count)]
