"""Makes `problem_sets.json`: `python -m services.bench.problem_making [arm/scene ...]`, many minutes for all of them.

Pairs of random free postures are drawn until there are enough between which a way is known. Those that nothing finds a
way for are left out: for rm1 a grid of all postures says whether there is one, for parol6 searches with seconds do. A
planner that is better than all of these can only gain by that; one that fails here has failed what is possible.
"""

from __future__ import annotations

import random
import sys
import time

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.joint_grid import JointGrid
from services.bench.known_ways import shortest
from services.bench.plan_scenes import SCENES
from services.bench.problem_sets import COUNT, FILE, Problem, ProblemSet, problem_sets, request_of, text_of, way_length
from services.planner.collision.checker import CollisionChecker
from services.planner.collision.clearance import CLEARANCE
from services.planner.collision.world import World
from services.planner.kinematics.goals import Goals
from services.planner.path.native_search import NATIVE
from services.planner.path.path import PathNotFound
from services.planner.path.search import Search
from services.planner.path.validity import ValidityChecker
from services.planner.request.deadline import NEVER, Deadline, Stopwatch, endless

Array = NDArray[np.float64]

SEED = 2
DIGITS = 4  # of a joint value: what is not stored is not part of the problem
MOST_GOALS = 8
LONG = 5.0  # [s] for a search
FEW_JOINTS = 3  # of which all postures can be looked at


class Maker:
    """For one arm in one scene."""

    def __init__(self, arm: Arm, scene: str) -> None:
        self.arm, self.scene = arm, scene
        self.kinematics = Kinematics(arm)
        self._around = CollisionChecker(World(arm, self.kinematics, SCENES[scene]))
        self._validity = ValidityChecker(self._around, CLEARANCE)
        self._speeds = np.array([joint.velocity for joint in arm.joints])
        self._search = Search(arm, self._around)
        is_small = len(arm.joints) <= FEW_JOINTS
        self._grid = JointGrid(arm, self._around.reach, self._validity) if is_small else None

    def made(self) -> ProblemSet:
        """The whole set; postures and tool poses are asked for in turns."""
        generator, problems, drawn = random.Random(SEED), list[Problem](), 0
        while len(problems) < COUNT:
            drawn += 1
            start, goal = self.free_posture(generator), self.free_posture(generator)
            problem = self.problem(start, goal, is_pose=len(problems) % 2 == 0)
            if problem is not None:
                problems.append(problem)
        return ProblemSet(self.arm.name, self.scene, drawn, tuple(problems))

    def free_posture(self, generator: random.Random) -> tuple[float, ...]:
        """Random joint values within the limits at which nothing is nearer than the clearance."""
        while True:
            drawn = (generator.uniform(joint.lower, joint.upper) for joint in self.arm.joints)
            posture = tuple(round(value, DIGITS) for value in drawn)
            is_within = all(joint.is_within(value) for joint, value in zip(self.arm.joints, posture, strict=True))
            if is_within and self._around.keeps(posture, CLEARANCE):
                return posture

    def problem(self, start: tuple[float, ...], goal: tuple[float, ...], is_pose: bool) -> Problem | None:
        """None where no way is known from the one posture to the other."""
        begin, end = np.array(start), np.array(goal)
        known = self.way(begin, end)
        if known is None:
            return None
        asked = Problem(start, goal, is_pose, 0.0, "")
        goals = self.postures(asked) if is_pose else [end]
        rows, found_by = min((known, *self.better(begin, goals)), key=lambda way: way_length(way[0], self._speeds))
        return Problem(start, goal, is_pose, round(way_length(rows, self._speeds), DIGITS), found_by)

    def way(self, start: Array, goal: Array) -> tuple[Array, str] | None:
        """Any."""
        if self._validity.is_line_free(start, goal):
            return np.array([start, goal]), "straight"
        if self._grid and not self._grid.is_connected(start, goal):
            return None
        for planner_id in (NATIVE, "RRTConnect"):
            deadline = Deadline(time.perf_counter, LONG, time.perf_counter())
            try:
                way = self._search.find(start, goal[None], CLEARANCE, planner_id, SEED, deadline, Stopwatch(endless))
                return way.corners, planner_id
            except PathNotFound:
                continue
        print(f"{self.arm.name} {self.scene}: nothing finds a way {start.tolist()} {goal.tolist()}", flush=True)
        return (np.array([start, goal]), "grid") if self._grid else None

    def better(self, start: Array, goals: list[Array]) -> list[tuple[Array, str]]:
        """The straight line to the nearest goal, or what long runs find; nothing where they find nothing."""
        lines = [np.array([start, goal]) for goal in goals if self._validity.is_line_free(start, goal)]
        lines.sort(key=lambda line: way_length(line, self._speeds))
        least = min(way_length(np.array([start, goal]), self._speeds) for goal in goals)
        ways = [(line, "straight") for line in lines[:1]]
        if not lines or way_length(lines[0], self._speeds) > least:
            found = shortest(self.arm, self._around, start, np.array(goals))
            ways += [] if found is None else [found]
        return ways

    def postures(self, problem: Problem) -> list[Array]:
        """Free postures of the pose, the problem's own among them."""
        goal = request_of(problem, self.arm, self.kinematics).goal
        found = Goals(self.arm, self.kinematics, self._around).candidates(goal, problem.start, NEVER)
        free = [np.array(posture) for posture in found if self._around.keeps(posture, CLEARANCE)]
        return [np.array(problem.goal), *free[:MOST_GOALS]]


def main(chosen: list[str]) -> None:
    """Makes the chosen sets anew, all where none is named."""
    sets = {f"{each.arm}/{each.scene}": each for each in (problem_sets() if FILE.exists() else ())}
    for arm in (rm1(), parol6()):
        for scene in SCENES:
            if not chosen or f"{arm.name}/{scene}" in chosen:
                made = Maker(arm, scene).made()
                sets[f"{arm.name}/{scene}"] = made
                print(f"{arm.name} {scene}: {len(made.problems)} of {made.drawn} pairs drawn", flush=True)
                FILE.write_text(text_of(tuple(sets.values())))


if __name__ == "__main__":
    main(sys.argv[1:])
