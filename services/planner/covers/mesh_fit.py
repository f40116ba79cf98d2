"""Collision shapes for an arm that has only meshes: fitted to what each link looks like, and written into its URDF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import coal
import numpy as np
import trimesh
from numpy.typing import NDArray

from services.arm.description import Arm, load_arm
from services.arm.errors import DescriptionError, suggestion
from services.arm.kinematics import Kinematics
from services.arm.transforms import from_rpy
from services.arm.urdf_edit import with_collisions
from services.planner.covers.fitting import Fitted
from services.planner.covers.link_meshes import visual_mesh
from services.planner.covers.link_spheres import link_shapes, solid_of
from services.planner.covers.parts import shapes_around
from services.planner.covers.shapes import Mesh, Shape, ShapeKind, matrix_of
from services.planner.covers.solids import Solid
from services.planner.scene.solid_geometry import tree_of

Array = NDArray[np.float64]

MOST = 6  # shapes of a link
FACETS = 12  # along each edge of the box around a shape, where the way to the mesh is measured
OUTSIDE = 1e-6  # [m] that a corner may be outside the shapes as they are loaded again: a rounding


@dataclass(frozen=True)
class LinkFit:
    """The shapes around one link's mesh; `share` of the volume of the mesh's convex hull that they add up to."""

    link: str
    mesh: Mesh
    shapes: tuple[Fitted, ...]
    share: float
    overshoot: float  # [m] that the farthest point of the shapes is away from the mesh


def fit_links(arm: Arm, most: int = MOST, only: Sequence[str] = ()) -> list[LinkFit]:
    """Of every link with a visual mesh, or of those named; raises `DescriptionError` with what is wrong and where."""
    for name in only:
        if name not in arm.model.link_names:
            raise DescriptionError(
                f'{arm.urdf_path}: there is no link "{name}"{suggestion(name, arm.model.link_names)}'
            )
    wanted = [link for link in arm.model.links if not only or link.name in only]
    meshes = {link.name: visual_mesh(link, arm.urdf_path.parent) for link in wanted}
    bare = [name for name in only if meshes[name] is None]
    if bare or not any(meshes.values()):
        of = f'link "{bare[0]}" has' if bare else "its links have"
        raise DescriptionError(f"{arm.urdf_path}: {of} no visual mesh to fit shapes to: write <collision> by hand")
    return [_fit(name, mesh, most) for name, mesh in meshes.items() if mesh is not None]


def _fit(link: str, mesh: Mesh, most: int) -> LinkFit:
    shapes = tuple(shapes_around(mesh, most))
    hull = float(trimesh.convex.convex_hull(mesh.vertices).volume)
    return LinkFit(link, mesh, shapes, sum(shape.volume for shape in shapes) / hull, overshoot(shapes, mesh))


def overshoot(shapes: Sequence[Fitted], mesh: Mesh) -> float:
    """[m] from the mesh to the farthest point of the shapes' surface, of those that are in no other shape."""
    tree, point = tree_of(mesh), coal.Sphere(1e-9)
    farthest = 0.0
    for shape in shapes:
        there = _surface(shape)
        for other in shapes:
            if other is not shape:
                there = there[depths(other.shape, there) < OUTSIDE]
        for place in there:
            result = coal.DistanceResult()
            pose = coal.Transform3s(np.eye(3), place)
            away = coal.distance(tree, coal.Transform3s(), point, pose, coal.DistanceRequest(), result)
            farthest = max(farthest, float(away))
    return farthest


def _surface(shape: Fitted) -> Array:
    """(k, 3) points on it, its corners and rims among them: nearest to those of a box around it."""
    solid = solid_of(shape.shape)
    steps = np.linspace(-1.0, 1.0, FACETS + 1)
    across = np.array([(x, y) for x in steps for y in steps])
    sides = [np.insert(across, axis, side, axis=1) for axis in range(3) for side in (-1.0, 1.0)]
    local = solid.nearest(np.vstack(sides) * (solid.half * 1.01))
    pose = shape.shape.matrix
    return local @ pose[:3, :3].T + pose[:3, 3]


def depths(shape: Shape, points: Array) -> Array:
    """(n,) [m] that points (n, 3) are inside the shape, below 0 outside."""
    solid: Solid = solid_of(shape)
    return solid.depth((points - shape.pose[0]) @ shape.rotation)


def elements_of(shape: Fitted) -> list[str]:
    """The shape as <collision> elements; a capsule, which is not URDF, is a cylinder with a ball at either end."""
    size, origin = shape.size, shape.origin
    match shape.kind:
        case ShapeKind.BOX:
            return [_element(origin.xyz, origin.rpy, f'<box size="{_words(size)}"/>')]
        case ShapeKind.SPHERE:
            return [_element(origin.xyz, origin.rpy, f'<sphere radius="{_words(size)}"/>')]
    radius, length = _words(size[:1]), _words(size[1:])
    found = [_element(origin.xyz, origin.rpy, f'<cylinder radius="{radius}" length="{length}"/>')]
    if shape.kind is ShapeKind.CAPSULE:
        along = 0.5 * size[1] * matrix_of(((0.0, 0.0, 0.0), from_rpy(*origin.rpy)))[:3, 2]
        ends = [(np.array(origin.xyz) + side * along).tolist() for side in (-1.0, 1.0)]
        found += [_element(end, (0.0, 0.0, 0.0), f'<sphere radius="{radius}"/>') for end in ends]
    return found


def _element(xyz: Sequence[float], rpy: Sequence[float], geometry: str) -> str:
    origin = f'<origin xyz="{_words(xyz)}" rpy="{_words(rpy)}"/>'
    return f"<collision>\n  {origin}\n  <geometry>{geometry}</geometry>\n</collision>"


def _words(values: Sequence[float]) -> str:
    return " ".join(f"{round(value, 9) + 0.0:.9g}" for value in values)


def write_fits(arm: Arm, fits: Sequence[LinkFit]) -> Arm:
    """Puts the shapes into the URDF in place of those that the links have, and returns the arm, loaded again.

    Raises `DescriptionError` where not every shape is there then or a corner of a mesh is outside them, and the file is
    as it was. Raises OSError where it cannot be read or written.
    """
    wanted = {fit.link: [element for shape in fit.shapes for element in elements_of(shape)] for fit in fits}
    before = arm.urdf_path.read_bytes()
    try:
        after = with_collisions(before.decode("utf-8"), wanted).encode("utf-8")
    except ValueError as error:
        raise DescriptionError(f"{arm.urdf_path} cannot be edited: {error}") from error
    arm.urdf_path.write_bytes(after)
    try:
        changed = load_arm(arm.folder)
        _require_there(changed, fits, wanted)
    except ValueError:
        arm.urdf_path.write_bytes(before)
        raise
    return changed


def touching_states(arm: Arm) -> list[str]:
    """The named states in which two links touch that are no neighbours, in words: shapes hold more than meshes do."""
    own = Kinematics(arm).collisions
    neighbours = {frozenset((joint.parent, joint.child)) for joint in arm.model.joints}
    return [
        f'in the state "{state}" {" and ".join(pair)} touch'
        for state, posture in arm.named_states.items()
        for pair in own.pairs_within(posture)
        if frozenset(pair) not in neighbours
    ]


def _require_there(arm: Arm, fits: Sequence[LinkFit], wanted: dict[str, list[str]]) -> None:
    loaded = link_shapes(arm)
    for fit in fits:
        shapes = loaded.get(fit.link, ())
        if len(shapes) != len(wanted[fit.link]):
            raise DescriptionError(
                f'{arm.urdf_path}: link "{fit.link}" has {len(shapes)} collision shapes once it is loaded, not '
                f"{len(wanted[fit.link])}"
            )
        deepest = np.max([depths(shape, fit.mesh.vertices) for shape in shapes], axis=0)
        if deepest.min() < -OUTSIDE:
            raise DescriptionError(
                f'{arm.urdf_path}: link "{fit.link}" sticks {-1000.0 * deepest.min():.3g} mm out of its shapes'
            )
