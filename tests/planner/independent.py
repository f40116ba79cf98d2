"""The judge of the planner's trajectories, of other hands: MuJoCo's kinematics and distances, scipy's quintics."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.scene import PlanningScene
from tests.planner.mujoco_arm import MujocoArm

Array = NDArray[np.float64]
FAR = 10.0  # [m] beyond which no distance is told


class Touch(NamedTuple):
    """What is nearest in a configuration."""

    distance: float  # [m] negative inside
    first: str
    second: str


class Judge:
    """One arm in one scene; joint values are (n,) [rad] or [m] in the arm's order."""

    def __init__(self, arm: ArmDescription, scene: PlanningScene | None = None, is_drawn: bool = False) -> None:
        scene = scene or PlanningScene()
        built = MujocoArm(arm, scene, is_drawn)
        self._model, self._owners = built.model, built.owners
        self._data = mujoco.MjData(self._model)
        self._places = [int(self._model.joint(name).qposadr[0]) for name in arm.joint_names]
        self._base, self._tool = arm.base_frame, arm.tool_frame
        excused = _excused(arm, scene)
        pairs = [pair for pair in combinations(range(self._model.ngeom), 2) if self._is_checked(*pair, excused)]
        self._pairs = np.array(pairs, dtype=int).reshape(-1, 2)
        self._padding = np.array(built.paddings)[self._pairs].sum(axis=1)
        bounds = np.where(self._model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE, np.inf, self._model.geom_rbound)
        self._radii = bounds[self._pairs].sum(axis=1) + self._padding
        self._levers = self._levers_of()

    @property
    def pairs(self) -> set[frozenset[str]]:
        """The names of links and objects that are looked at."""
        return {frozenset(self._owners[index] for index in pair) for pair in self._pairs.tolist()}

    def nearest(self, positions: Array) -> Touch:
        """The two that are nearest to one another."""
        self._place(positions)
        centres = self._data.geom_xpos[self._pairs]
        bounds = np.linalg.norm(centres[:, 0] - centres[:, 1], axis=1) - self._radii
        found = Touch(FAR, "", "")
        for index in np.argsort(bounds).tolist():
            if bounds[index] >= found.distance:
                break
            one, other = self._pairs[index].tolist()
            padding = float(self._padding[index])
            most = found.distance + padding
            distance = mujoco.mj_geomDistance(self._model, self._data, one, other, most, None) - padding
            if distance < found.distance:
                found = Touch(distance, self._owners[one], self._owners[other])
        return found

    def touch(self, rows: Array) -> Touch | None:
        """The first touch in the rows (m, n); rows between which nothing can have come that near are left out."""
        moved = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(rows, axis=0)) @ self._levers)))
        row = 0
        while row < len(rows):
            found = self.nearest(rows[row])
            if found.distance <= 0.0:
                return found
            row = max(row + 1, int(np.searchsorted(moved, moved[row] + found.distance)))
        return None

    def pose(self, link: str, positions: Array) -> tuple[Array, Array]:
        """Position (3,) [m] and rotation (3, 3) of a link in the base frame."""
        self._place(positions)
        base, found = self._data.body(self._base), self._data.body(link)
        turn = base.xmat.reshape(3, 3).T
        return turn @ (found.xpos - base.xpos), turn @ found.xmat.reshape(3, 3)

    def tool(self, positions: Array) -> tuple[Array, Array]:
        """Of the tool."""
        return self.pose(self._tool, positions)

    def tool_way(self, rows: Array) -> Array:
        """(m, 3) [m] the tool's positions."""
        return np.array([self.tool(row)[0] for row in rows])

    def _place(self, positions: Array) -> None:
        self._data.qpos[self._places] = positions
        mujoco.mj_kinematics(self._model, self._data)

    def _is_checked(self, one: int, other: int, excused: set[frozenset[str]]) -> bool:
        """What a joint moves apart, and nobody has excused."""
        bodies = self._model.body_weldid[self._model.geom_bodyid[[one, other]]]
        names = (self._owners[one], self._owners[other])
        return bodies[0] != bodies[1] and not any(
            frozenset(pair) in excused for pair in (names, (names[0], "*"), ("*", names[1]))
        )

    def _levers_of(self) -> Array:
        """(n,) how far at most [m] any point of the arm moves per unit of each joint, all links in one line."""
        moving = self._model.body_weldid[self._model.geom_bodyid] != 0
        ends = np.linalg.norm(self._model.geom_pos, axis=1) + self._model.geom_rbound
        slides = self._model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        longest = np.linalg.norm(self._model.body_pos, axis=1).sum() + ends[moving].max() + slides.sum()
        return np.where(slides, 1.0, longest)[self._places]


def _excused(arm: ArmDescription, scene: PlanningScene) -> set[frozenset[str]]:
    """Pairs of names that may touch; "*" is any."""
    disabled = ET.parse(arm.srdf_path).getroot().findall("disable_collisions")
    pairs = [(pair.get("link1"), pair.get("link2")) for pair in disabled]
    pairs += [(pair.first, pair.second) for pair in scene.allowed]
    for item in scene.objects:
        if item.attached:
            pairs += [(item.name, link) for link in (item.frame, *item.touch_links)]
    return {frozenset(pair) for pair in pairs}


class Motion(NamedTuple):
    """Rows in time (m, n)."""

    times: Array  # (m,) [s]
    positions: Array
    velocities: Array
    accelerations: Array
    jerks: Array


def resampled(trajectory: JointTrajectory, density: int) -> Motion:
    """The quintics through the points, at `density` instants between two of them, by Bernstein's polynomials."""
    points = trajectory.points
    stamps = np.array([point.time_from_start for point in points])
    assert (np.diff(stamps) > 0.0).all()
    known = np.array([(point.positions, point.velocities, point.accelerations) for point in points])
    curve = BPoly.from_derivatives(stamps, known, orders=5)
    shares = np.arange(density) / density
    times = np.append((stamps[:-1, None] + shares * np.diff(stamps)[:, None]).reshape(-1), stamps[-1])
    return Motion(times, *(np.asarray(curve(times, order)) for order in range(4)))
