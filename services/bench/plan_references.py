"""What others take for the same problems, posture to posture: a free polyline, shortened, not timed nor verified.

Both look at postures `STEP` apart, not between them, so some of their ways touch; the planner's own do not.
"""

from __future__ import annotations

import time
from itertools import combinations
from typing import Any, Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from schemas.frames import Transform
from schemas.scene import BoxShape, CylinderShape, PlanningScene
from services.arm.description import Arm
from services.bench.figure import NotMeasured
from services.bench.postures import CoalChecker
from services.bench.problem_sets import ALLOWED

Array = NDArray[np.float64]
Posture = tuple[float, ...]

STEP = 0.02  # [rad], [m] between two postures that are looked at
MOST_NODES = 100_000
GROUP = "bench"


class Reference(Protocol):
    """Plans for one arm in one scene."""

    def __init__(self, arm: Arm, scene: PlanningScene) -> None: ...
    def solving_ms(self, start: Posture, goal: Posture, seed: int) -> float | None: ...


class PlainOmpl:
    """OMPL's RRTConnect and its simplification, as they come, with a checker in Python on pinocchio and coal."""

    def __init__(self, arm: Arm, scene: PlanningScene) -> None:
        from ompl import base, geometric, util

        util.noOutputHandler()
        self._base, self._geometric, self._util = base, geometric, util
        checker, joints = CoalChecker(arm, scene), len(arm.joints)
        space = base.RealVectorStateSpace(joints)
        bounds = base.RealVectorBounds(joints)
        for index, joint in enumerate(arm.joints):
            bounds.setLow(index, joint.lower)
            bounds.setHigh(index, joint.upper)
        space.setBounds(bounds)
        self._information = base.SpaceInformation(space)
        self._information.setStateValidityChecker(  # without `self`: OMPL never lets go of it
            lambda state: checker.is_free(np.array([state[index] for index in range(joints)]))
        )
        self._information.setStateValidityCheckingResolution(STEP / space.getMaximumExtent())
        self._information.setup()

    def solving_ms(self, start: Posture, goal: Posture, seed: int) -> float | None:
        self._util.RNG.setSeed(seed + 1)
        began = time.perf_counter()
        definition = self._base.ProblemDefinition(self._information)
        definition.setStartAndGoalStates(self._state(start), self._state(goal))
        planner = self._geometric.RRTConnect(self._information)
        planner.setProblemDefinition(definition)
        planner.setup()
        planner.solve(self._base.timedPlannerTerminationCondition(ALLOWED))
        if not definition.hasExactSolution():
            return None
        self._geometric.PathSimplifier(self._information).simplifyMax(definition.getSolutionPath())
        return (time.perf_counter() - began) * 1e3

    def _state(self, posture: Posture) -> Any:
        state = self._information.allocState()
        for index, value in enumerate(posture):
            state[index] = value
        return state


class Roboplan:
    """roboplan's RRT-Connect and path shortcutting, all of it compiled; raises `NotMeasured` where it is not there."""

    def __init__(self, arm: Arm, scene: PlanningScene) -> None:
        try:
            from roboplan import core, rrt
        except ImportError as error:
            raise NotMeasured(f"{error}: it is among the packages of requirements.lock, run `make setup`") from error
        self._core = core
        self._scene = core.Scene(arm.name, core.loadUrdfSceneDescription(str(arm.urdf_path), [str(arm.folder)]))
        self._scene.importSrdf(arm.srdf_path.read_text())
        self._scene.addGroup(GROUP, list(arm.joint_names))
        self._show(scene)
        options = rrt.RRTOptions(
            group_name=GROUP,
            max_nodes=MOST_NODES,
            max_planning_time=ALLOWED,
            rrt_connect=True,
            collision_check_step_size=STEP,
        )
        self._planner = rrt.RRT(self._scene, options)

    def solving_ms(self, start: Posture, goal: Posture, seed: int) -> float | None:
        names = self._scene.getJointNames()
        ends = [self._core.JointConfiguration(names, np.array(posture)) for posture in (start, goal)]
        self._planner.setRngSeed(seed)
        options = self._core.PathShortcuttingOptions(group_name=GROUP, max_step_size=STEP, seed=seed)
        began = time.perf_counter()
        try:
            path = self._planner.plan(*ends)
        except RuntimeError:
            return None
        self._core.PathShortcutter(self._scene, options).shortcut(path)
        return (time.perf_counter() - began) * 1e3

    def _show(self, scene: PlanningScene) -> None:
        for item in scene.objects:
            match item.shape:
                case BoxShape(size=size):
                    add, shape = self._scene.addBoxGeometry, self._core.Box(*size)
                case CylinderShape(radius=radius, length=length):
                    add, shape = self._scene.addCylinderGeometry, self._core.Cylinder(radius, length)
                case _:
                    raise NotMeasured(f'roboplan is given no such shape as "{item.name}"')
            add(item.name, "universe", shape, placed(item.pose), np.ones(4))
        names = [item.name for item in scene.objects]
        self._scene.setCollisions(list(combinations(names, 2)), False)  # or boards that touch end every search

    def is_free(self, posture: Array) -> bool:
        return not self._scene.hasCollisions(posture)


def placed(pose: Transform) -> Array:
    """(4, 4) by columns."""
    return np.asfortranarray(pin.XYZQUATToSE3(np.array([*pose.translation, *pose.rotation])).homogeneous)
