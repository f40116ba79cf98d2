"""Other libraries on the same problems: collision checks by pinocchio and coal, plans by OMPL and roboplan.

The references search for a free polyline between two configurations and shorten it; they neither time nor verify it.
They check configurations `STEP` apart and nothing in between, so some of their paths collide; the planner's do not.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from itertools import combinations
from typing import Any, NamedTuple, Protocol

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.joint_mapping import JointMapping
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, Shape
from gemelo.tools.bench.figures import NotMeasured
from gemelo.tools.bench.problems.problem_sets import ALLOWED

Array = NDArray[np.float64]
JointValues = tuple[float, ...]  # [rad] or [m], in the arm's order

STEP = 0.02  # [rad], [m] between two checked configurations
MOST_NODES = 100_000
GROUP = "bench"


@dataclass
class CoalChecker:
    """pinocchio and coal on the collision shapes of links and scene: one configuration a call."""

    arm: ArmDescription
    scene: PlanningScene

    def __post_init__(self) -> None:
        self._model = pin.buildModelFromUrdf(str(self.arm.urdf_path))
        self._data = self._model.createData()
        self._configuration = JointMapping(self.arm, self._model)
        kind = pin.GeometryType.COLLISION
        folder = [str(self.arm.folder)]
        self._geometry = pin.buildGeomFromUrdf(self._model, str(self.arm.urdf_path), kind, package_dirs=folder)
        links = [self._model.frames[item.parentFrame].name for item in self._geometry.geometryObjects]
        moving = [index for index, item in enumerate(self._geometry.geometryObjects) if item.parentJoint != 0]
        for first in range(len(links)):
            for second in range(first + 1, len(links)):
                if links[first] != links[second] and not self.arm.collisions_are_disabled(links[first], links[second]):
                    self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        for item in self.scene.objects:
            placement = pin.XYZQUATToSE3(np.array([*item.pose.translation, *item.pose.rotation]))
            solid = pin.GeometryObject(item.name, 0, 0, placement, solid_of(item.shape))
            obstacle = self._geometry.addGeometryObject(solid)
            for index in moving:
                self._geometry.addCollisionPair(pin.CollisionPair(index, obstacle))
        self._geometry_data = self._geometry.createData()

    def is_free(self, configuration: Array) -> bool:
        """True if no checked pair is in contact at `configuration` (n,) [rad] or [m]."""
        q = self._configuration.to_pinocchio(configuration)
        return not pin.computeCollisions(self._model, self._data, self._geometry, self._geometry_data, q, True)


def solid_of(shape: Shape) -> coal.CollisionGeometry:
    """The coal geometry of a box or cylinder [m]; raises ValueError for any other shape."""
    match shape:
        case BoxShape(size=size):
            return coal.Box(*size)
        case CylinderShape(radius=radius, length=length):
            return coal.Cylinder(radius, length)
    raise ValueError(f"the bench's scenes have boxes and cylinders, not {shape}")


class ReferenceResult(NamedTuple):
    """What a reference has found: times [ms] of the clock and of the CPU, and the polyline (m, n) [rad] or [m]."""

    took: float
    worked: float
    rows: Array


class Reference(Protocol):
    """A planner for one arm in one scene."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene) -> None: ...
    def shortened_path(self, start: JointValues, goal: JointValues, seed: int) -> ReferenceResult | None:
        """A shortened path; None if none is found within `ALLOWED`."""


class PlainOmpl:
    """OMPL's RRTConnect and PathSimplifier with default parameters and `CoalChecker` as its state validity checker."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene) -> None:
        from ompl import base, geometric, util  # slow to load

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
        self._information.setStateValidityChecker(  # refers to no `self`: OMPL keeps the callable for ever
            lambda state: checker.is_free(np.array([state[index] for index in range(joints)]))
        )
        self._information.setStateValidityCheckingResolution(STEP / space.getMaximumExtent())
        self._information.setup()

    def shortened_path(self, start: JointValues, goal: JointValues, seed: int) -> ReferenceResult | None:
        """A path from `start` to `goal`, (n,) [rad] or [m], shortened; None if none is found within `ALLOWED`."""
        self._util.RNG.setSeed(seed + 1)
        began, before = time.perf_counter(), time.process_time()
        definition = self._base.ProblemDefinition(self._information)
        definition.setStartAndGoalStates(self._state(start), self._state(goal))
        planner = self._geometric.RRTConnect(self._information)
        planner.setProblemDefinition(definition)
        planner.setup()
        planner.solve(self._base.timedPlannerTerminationCondition(ALLOWED))
        if not definition.hasExactSolution():
            return None
        path = definition.getSolutionPath()
        self._geometric.PathSimplifier(self._information).simplifyMax(path)
        took, worked = time.perf_counter() - began, time.process_time() - before
        rows = [[state[index] for index in range(len(start))] for state in path.getStates()]
        return ReferenceResult(took * 1e3, worked * 1e3, np.array(rows))

    def _state(self, configuration: JointValues) -> Any:
        state = self._information.allocState()
        for index, value in enumerate(configuration):
            state[index] = value
        return state


class Roboplan:
    """roboplan's compiled RRT-Connect and path shortcutting; raises `NotMeasured` if it is not installed."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene) -> None:
        try:
            from roboplan import core, rrt  # not there on every machine
        except ImportError as error:
            raise NotMeasured(f"{error}: it is among the packages of requirements.lock, run `make setup`") from error
        self._core = core
        self._scene = core.Scene(arm.name, core.loadUrdfSceneDescription(str(arm.urdf_path), [str(arm.folder)]))
        self._scene.importSrdf(arm.srdf_path.read_text())
        self._scene.addGroup(GROUP, list(arm.joint_names))
        self._add_objects(scene)
        options = rrt.RRTOptions(
            group_name=GROUP,
            max_nodes=MOST_NODES,
            max_planning_time=ALLOWED,
            rrt_connect=True,
            collision_check_step_size=STEP,
        )
        self._planner = rrt.RRT(self._scene, options)

    def shortened_path(self, start: JointValues, goal: JointValues, seed: int) -> ReferenceResult | None:
        """A path from `start` to `goal`, (n,) [rad] or [m], shortened; None if none is found within `ALLOWED`."""
        names = self._scene.getJointNames()
        ends = [self._core.JointConfiguration(names, np.array(values)) for values in (start, goal)]
        self._planner.setRngSeed(seed)
        options = self._core.PathShortcuttingOptions(group_name=GROUP, max_step_size=STEP, seed=seed)
        began, before = time.perf_counter(), time.process_time()
        try:
            path = self._planner.plan(*ends)
        except RuntimeError:
            return None
        short = self._core.PathShortcutter(self._scene, options).shortcut(path)
        took, worked = time.perf_counter() - began, time.process_time() - before
        return ReferenceResult(took * 1e3, worked * 1e3, np.array(short.positions))

    def _add_objects(self, scene: PlanningScene) -> None:
        for item in scene.objects:
            match item.shape:
                case BoxShape(size=size):
                    add, shape = self._scene.addBoxGeometry, self._core.Box(*size)
                case CylinderShape(radius=radius, length=length):
                    add, shape = self._scene.addCylinderGeometry, self._core.Cylinder(radius, length)
                case _:
                    raise NotMeasured(f'roboplan is given boxes and cylinders only, not "{item.name}"')
            add(item.name, "universe", shape, placed(item.pose), np.ones(4))
        names = [item.name for item in scene.objects]
        # Objects that touch one another would put every configuration in collision.
        self._scene.setCollisions(list(combinations(names, 2)), False)

    def is_free(self, configuration: Array) -> bool:
        """True if roboplan finds no collision at `configuration` (n,) [rad] or [m]."""
        return not self._scene.hasCollisions(configuration)


def placed(pose: Transform) -> Array:
    """`pose` as a homogeneous matrix (4, 4) in column order, translation in [m]."""
    return np.asfortranarray(pin.XYZQUATToSE3(np.array([*pose.translation, *pose.rotation])).homogeneous)
