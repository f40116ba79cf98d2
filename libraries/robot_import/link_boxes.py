"""The places of the shapes of a link: boxes along the link's axes, and how far they are from its joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.checks.meshes import Facts, MeshFacts
from gemelo.libraries.arm.frames.transforms import Rigid, compose, from_rpy, rotate
from gemelo.libraries.arm.model.urdf import Geometry, UrdfJoint, UrdfLink, UrdfModel

Array = NDArray[np.float64]
Box = tuple[Array, Array]  # (3,) [m] each: the least and the most of each axis


def corners_of(shape: Geometry, facts: Facts) -> Array | None:
    """(8, 3) of the box around a shape in its own axes, a mesh's scaled as written; None where that is not known."""
    known = facts(shape) if shape.mesh is not None else None
    if isinstance(known, MeshFacts):
        ends = np.array((known.low, known.high)) * np.array(shape.scale)
    elif shape.mesh is None and shape.size:
        halves = {"box": shape.size, "sphere": 3 * tuple(2.0 * value for value in shape.size)}.get(shape.shape)
        if halves is None:  # a cylinder
            halves = (2.0 * shape.size[0], 2.0 * shape.size[0], shape.size[-1])
        ends = np.array((halves, halves)) * np.array([[-0.5], [0.5]])
    else:
        return None
    return np.array([[ends[i][0], ends[j][1], ends[k][2]] for i, j, k in product((0, 1), repeat=3)])


def placed(corners: Array, pose: Rigid) -> Array:
    """(n, 3) [m] the points where `pose` takes them."""
    return np.array([np.add(pose[0], rotate(pose[1], (x, y, z))) for x, y, z in corners.tolist()])


def pose_of(shape: Geometry) -> Rigid:
    """Of its origin in the link."""
    return shape.origin.xyz, from_rpy(*shape.origin.rpy)


def box_of(shapes: Sequence[Geometry], facts: Facts, outer: Callable[[Geometry], Rigid] | None = None) -> Box | None:
    """[m] around all shapes whose size is known, each moved by `outer` if that is given; None where there is none."""
    found = []
    for shape in shapes:
        corners = corners_of(shape, facts)
        if corners is not None:
            pose = pose_of(shape)
            found.append(placed(corners, pose if outer is None else compose(outer(shape), pose)))
    if not found:
        return None
    points = np.vstack(found)
    return points.min(axis=0), points.max(axis=0)


def distance_to(box: Box, point: Sequence[float]) -> float:
    """[m] from a point to the box; 0 in it."""
    low, high = box
    return float(np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0.0)))


def between(one: Box, other: Box) -> float:
    """[m] between two boxes; 0 where they overlap."""
    return float(np.linalg.norm(np.maximum(np.maximum(one[0] - other[1], other[0] - one[1]), 0.0)))


def diagonal(box: Box) -> float:
    """[m]"""
    return float(np.linalg.norm(box[1] - box[0]))


def joints_at(link: UrdfLink, model: UrdfModel) -> list[Array]:
    """(3,) [m] each: where the joints of a link are in its frame, its own at the origin, those that it carries."""
    own = [np.zeros(3)] if any(joint.child == link.name for joint in model.joints) else []
    return [*own, *(np.array(joint.origin.xyz) for joint in carried_by(link, model))]


def carried_by(link: UrdfLink, model: UrdfModel) -> list[UrdfJoint]:
    return [joint for joint in model.joints if joint.parent == link.name]


def longest_joint(model: UrdfModel) -> float:
    """[m] between the two joints that are the farthest apart on one link; 0 where all are in one place."""
    return max((float(np.linalg.norm(joint.origin.xyz)) for joint in model.joints), default=0.0)
