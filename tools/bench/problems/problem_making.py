"""Makes `problem_sets.json`: `python -m gemelo.tools.bench.problems.problem_making [arm/scene ...]`, in many minutes.

Pairs of random free configurations are drawn until enough have a known path. Pairs without one are left out: for rm1 a
grid over all configurations decides whether a path exists, for parol6 searches of several seconds do. So a planner
that fails on a problem has failed where a solution is known.
"""

from __future__ import annotations

import random
import sys
import time

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planners import NATIVE
from gemelo.services.planner.collision.checker import CollisionChecker
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.kinematics.goals import Goals
from gemelo.services.planner.path.path import PathNotFound
from gemelo.services.planner.path.search import Search
from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import NEVER, Deadline, Stopwatch, endless
from gemelo.tools.bench.problems.known_paths import JointGrid, shortest
from gemelo.tools.bench.problems.problem_sets import (
    COUNT,
    FILE,
    PlanningProblem,
    ProblemSet,
    path_length,
    problem_sets,
    request_of,
    text_of,
)
from gemelo.tools.bench.scenes import SCENES, parol6, rm1

Array = NDArray[np.float64]

SEED = 2
DIGITS = 4  # of a stored joint value; the problem is made with the rounded one
MOST_GOALS = 8
LONG = 5.0  # [s] for a search
FEW_JOINTS = 3  # up to so many a grid over all configurations is feasible


class Maker:
    """Makes the problems of one arm in one scene."""

    def __init__(self, arm: ArmDescription, scene: str) -> None:
        self.arm, self.scene = arm, scene
        self.kinematics = Kinematics(arm)
        self._around = CollisionChecker(World(arm, self.kinematics, SCENES[scene]))
        self._validity = ValidityChecker(self._around, CLEARANCE)
        self._speeds = np.array([joint.velocity for joint in arm.joints])
        self._search = Search(arm, self._around)
        is_small = len(arm.joints) <= FEW_JOINTS
        self._grid = JointGrid(arm, self._around.reach, self._validity) if is_small else None

    def made(self) -> ProblemSet:
        """The whole set; the goals are joint values and tool poses in turns."""
        generator, problems, drawn = random.Random(SEED), list[PlanningProblem](), 0
        while len(problems) < COUNT:
            drawn += 1
            start, goal = self.free_configuration(generator), self.free_configuration(generator)
            problem = self.problem(start, goal, is_pose=len(problems) % 2 == 0)
            if problem is not None:
                problems.append(problem)
        return ProblemSet(self.arm.name, self.scene, drawn, tuple(problems))

    def free_configuration(self, generator: random.Random) -> tuple[float, ...]:
        """Random joint values [rad] or [m] within the limits at which no pair is closer than the clearance."""
        while True:
            drawn = (generator.uniform(joint.lower, joint.upper) for joint in self.arm.joints)
            configuration = tuple(round(value, DIGITS) for value in drawn)
            is_within = all(joint.is_within(value) for joint, value in zip(self.arm.joints, configuration, strict=True))
            if is_within and self._around.keeps(configuration, CLEARANCE):
                return configuration

    def problem(self, start: tuple[float, ...], goal: tuple[float, ...], is_pose: bool) -> PlanningProblem | None:
        """The problem from `start` to `goal`, (n,) [rad] or [m]; None if no path between them is known."""
        begin, end = np.array(start), np.array(goal)
        known = self.any_path(begin, end)
        if known is None:
            return None
        wanted = PlanningProblem(start, goal, is_pose, 0.0, "")
        goals = self.configurations(wanted) if is_pose else [end]
        rows, found_by = min((known, *self.better(begin, goals)), key=lambda path: path_length(path[0], self._speeds))
        return PlanningProblem(start, goal, is_pose, round(path_length(rows, self._speeds), DIGITS), found_by)

    def any_path(self, start: Array, goal: Array) -> tuple[Array, str] | None:
        """Any free polyline (m, n) [rad] or [m] and what found it; None if no path is known."""
        if self._validity.is_line_free(start, goal):
            return np.array([start, goal]), "straight"
        if self._grid and not self._grid.is_connected(start, goal):
            return None
        for planner_id in (NATIVE, "RRTConnect"):
            deadline = Deadline(time.perf_counter, LONG, time.perf_counter())
            try:
                found = self._search.find(start, goal[None], CLEARANCE, planner_id, SEED, deadline, Stopwatch(endless))
                return found.corners, planner_id
            except PathNotFound:
                continue
        print(f"{self.arm.name} {self.scene}: no path is found from {start.tolist()} to {goal.tolist()}", flush=True)
        return (np.array([start, goal]), "grid") if self._grid else None

    def better(self, start: Array, goals: list[Array]) -> list[tuple[Array, str]]:
        """The shortest straight line to a goal, if one is free, and the shortest path of long searches, unless that
        line ends at the nearest goal: polylines (m, n) [rad] or [m], each with what found it."""
        lines = [np.array([start, goal]) for goal in goals if self._validity.is_line_free(start, goal)]
        lines.sort(key=lambda line: path_length(line, self._speeds))
        least = min(path_length(np.array([start, goal]), self._speeds) for goal in goals)
        paths = [(line, "straight") for line in lines[:1]]
        if not lines or path_length(lines[0], self._speeds) > least:
            found = shortest(self.arm, self._around, start, np.array(goals))
            paths += [] if found is None else [found]
        return paths

    def configurations(self, problem: PlanningProblem) -> list[Array]:
        """Free configurations (n,) [rad] or [m] of the tool pose, the problem's own first."""
        goal = request_of(problem, self.arm, self.kinematics).goal
        found = Goals(self.arm, self.kinematics, self._around).candidates(goal, problem.start, NEVER)
        free = [np.array(each) for each in found if self._around.keeps(each, CLEARANCE)]
        return [np.array(problem.goal), *free[:MOST_GOALS]]


def main(chosen: list[str]) -> None:
    """Makes the sets in `chosen` ("arm/scene") anew; all of them if it is empty."""
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
