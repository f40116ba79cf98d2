"""The arm as it is drawn: links with their visuals, joints with their motion.

Joint motion follows the URDF specification: a child link's pose in its parent is the joint's origin, then a
rotation about, or a translation along, the joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from gemelo.services.visualizer.model.rotations import Array, multiply, rotate


@dataclass(frozen=True)
class VisualShape:
    """A primitive or a mesh file; sizes in m."""

    kind: str  # "box", "cylinder", "sphere", "mesh"
    size: tuple[float, ...] = ()  # box: x y z; cylinder: radius, length; sphere: radius; mesh: scale x y z
    file: str = ""


@dataclass(frozen=True)
class Visual:
    """A shape where it sits on its link."""

    shape: VisualShape
    translation: Array  # (3,) [m]
    rotation: Array  # (4,) quaternion x y z w
    color: tuple[int, int, int] | None


@dataclass(frozen=True)
class VisualJoint:
    """A joint: the motion of a link relative to its parent."""

    name: str
    kind: str  # as in URDF: revolute, continuous, prismatic, fixed
    parent: str
    child: str
    translation: Array  # (3,) [m]
    rotation: Array  # (4,) quaternion x y z w
    axis: Array  # (3,) unit
    mimic: tuple[str, float, float] | None = None  # joint, multiplier, offset
    travel: float = 0.0  # [m] of a prismatic joint, upper - lower
    middle: float = 0.0  # [rad] or [m] half way between its limits

    @property
    def is_moving(self) -> bool:
        return self.kind != "fixed"

    @property
    def is_prismatic(self) -> bool:
        return self.kind == "prismatic"

    def poses(self, positions: Array) -> tuple[Array, Array]:
        """Translations (n, 3) and quaternions (n, 4) of the child in its parent, for positions (n,)."""
        count = len(positions)
        rotations = np.broadcast_to(self.rotation, (count, 4))
        if self.is_prismatic:
            return self.translation + positions[:, None] * rotate(self.rotation, self.axis), rotations
        half = positions[:, None] / 2.0
        turn = np.hstack([self.axis * np.sin(half), np.cos(half)])
        return np.broadcast_to(self.translation, (count, 3)), multiply(rotations, turn)


@dataclass(frozen=True)
class VisualModel:
    """A tree of links."""

    name: str
    root: str
    joints: tuple[VisualJoint, ...]  # parents before children
    visuals: dict[str, tuple[Visual, ...]]  # by link
    paths: dict[str, str] = field(default_factory=dict)  # link -> "root/.../link", an entity path

    @property
    def moving(self) -> tuple[VisualJoint, ...]:
        """The joints with a position of their own, in the order of the tree."""
        return tuple(joint for joint in self.joints if joint.is_moving and joint.mimic is None)

    @property
    def reach(self) -> float:
        """[m] an upper bound of the distance from the base to the tip."""
        return sum(float(np.linalg.norm(joint.translation)) + joint.travel for joint in self.joints) or 0.5

    @property
    def height(self) -> float:
        """[m] how high the highest frame is above the root with every joint in its middle."""
        names = [joint.name for joint in self.moving]
        middles = np.array([[joint.middle for joint in self.moving]])
        heights = (float(self.link_positions(joint.child, middles, names)[0, 2]) for joint in self.joints)
        return max(heights, default=0.0)

    def positions(self, joint: VisualJoint, rows: Array, names: list[str]) -> Array:
        """The positions (n,) [rad] or [m] of `joint` from rows (n, len(names)), by its mimic where it has one."""
        if joint.mimic is None:
            return np.asarray(rows[:, names.index(joint.name)])
        leader, multiplier, offset = joint.mimic
        return np.asarray(rows[:, names.index(leader)] * multiplier + offset)

    def link_positions(self, link: str, rows: Array, names: list[str]) -> Array:
        """The origin of `link` in the root's frame, (n, 3) [m], for joint positions (n, len(names)) [rad] or [m]."""
        points = np.zeros((len(rows), 3))
        above = {joint.child: joint for joint in self.joints}
        while link != self.root:
            joint = above[link]
            values = self.positions(joint, rows, names) if joint.is_moving else np.zeros(len(rows))
            translations, rotations = joint.poses(values)
            points = rotate(rotations, points) + translations
            link = joint.parent
        return points
