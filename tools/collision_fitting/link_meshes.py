"""The meshes that a link touches with, else those it is drawn with, as one mesh in its frame: read by trimesh, refused
where they cannot be a link."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.checks.meshes import IN_MILLIMETRES, MOST_TRIANGLES, scene_of
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.urdf import Geometry, UrdfLink
from gemelo.schemas.reasons import Reason, because
from gemelo.services.planner.collision_geometry.shapes import TriangleMesh, matrix_of

Array = NDArray[np.float64]

HULLS = "meshes/collision"  # from the URDF on: where fitted hulls are
# Tuning constants: chosen, where a line does not say measured or standard.
SMALLEST, LARGEST = 0.002, IN_MILLIMETRES  # [m] along its longest side; what is beyond is in another unit
FLAT = 1e-3  # thickness as a share of the longest side below which a mesh is no solid
ROUND = 48  # sides of a cylinder that stands among the meshes of a link


def link_mesh(link: UrdfLink, folder: Path) -> TriangleMesh | None:
    """What shapes are fitted to, in the link's frame [m]: its own collision meshes with the shapes among them, else its
    visual meshes; None where it has neither. Raises `DescriptionError` with the file."""
    own = own_collisions(link)
    if not own:
        return visual_mesh(link, folder)
    return _joined([_placed(shape, link.name, folder) for shape in own])


def own_collisions(link: UrdfLink) -> tuple[Geometry, ...]:
    """The collision shapes where one of them is a mesh that was not fitted, but given with the robot."""
    given = any(shape.mesh is not None and not shape.mesh.startswith(f"{HULLS}/") for shape in link.collisions)
    return link.collisions if given else ()


def visual_mesh(link: UrdfLink, folder: Path) -> TriangleMesh | None:
    """All visual meshes of a link in its frame [m], None where it has none; raises `DescriptionError` with the file."""
    found = [_placed(visual, link.name, folder) for visual in link.visuals if visual.mesh is not None]
    return _joined(found) if found else None


def _joined(found: Sequence[TriangleMesh]) -> TriangleMesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in found)])
    faces = np.vstack([mesh.faces + start for mesh, start in zip(found, starts[:-1], strict=True)])
    return TriangleMesh(np.vstack([mesh.vertices for mesh in found]), faces.astype(np.int32))


class Where(NamedTuple):
    """A mesh of a link."""

    link: str
    file: str

    def error(self, why: Reason) -> DescriptionError:
        """What is wrong with it, with its place."""
        return DescriptionError(because("fit.mesh", why, link=self.link, file=self.file))


def _placed(visual: Geometry, link: str, folder: Path) -> TriangleMesh:
    pose = matrix_of((visual.origin.xyz, from_rpy(*visual.origin.rpy)))
    if visual.mesh is None:
        solid = _solid(visual, link)
        return TriangleMesh(solid.vertices @ pose[:3, :3].T + pose[:3, 3], solid.faces)
    if visual.mesh.startswith("package://"):
        raise DescriptionError(because("fit.mesh.package", link=link, mesh=visual.mesh, folder=str(folder)))
    path = folder / visual.mesh.removeprefix("file://")
    where = Where(link, str(path))
    mesh = _read(path, where)
    scaled = mesh.vertices * np.array(visual.scale)
    _require_solid(scaled, where)
    return TriangleMesh(scaled @ pose[:3, :3].T + pose[:3, 3], mesh.faces)


def _solid(shape: Geometry, link: str) -> TriangleMesh:
    """Triangles of a box, a cylinder or a ball about its own origin; a round one's corners are outside of it."""
    import trimesh  # half a second

    wider = 1.0 / math.cos(math.pi / ROUND)
    match shape.shape:
        case "box":
            solid = trimesh.creation.box(shape.size)
        case "cylinder":
            solid = trimesh.creation.cylinder(wider * shape.size[0], shape.size[1], ROUND)
        case "sphere":
            solid = trimesh.creation.icosphere(3, wider * shape.size[0])
        case _:
            raise DescriptionError(because("fit.shape.unknown", link=link, shape=shape.shape))
    return TriangleMesh(np.asarray(solid.vertices, dtype=float), np.asarray(solid.faces, dtype=np.int32))


def _read(path: Path, where: Where) -> TriangleMesh:
    """Vertices that a triangle uses, in the file's unit."""
    if not path.is_file():
        raise where.error(because("fit.mesh.absent"))
    try:
        whole = scene_of(path).to_mesh()
        vertices, faces = np.asarray(whole.vertices, dtype=float), np.asarray(whole.faces, dtype=np.int32)
    except Exception as error:  # whatever its many readers raise for a damaged file
        raise where.error(because("fit.mesh.unreadable", error=str(error))) from error
    if not len(faces):
        raise where.error(because("fit.mesh.empty"))
    if len(faces) > MOST_TRIANGLES:
        raise where.error(because("fit.mesh.fine", count=len(faces), most=MOST_TRIANGLES))
    used, numbers = np.unique(faces, return_inverse=True)
    if not np.isfinite(vertices[used]).all():
        raise where.error(because("fit.mesh.not_finite"))
    return TriangleMesh(vertices[used], numbers.reshape(-1, 3).astype(np.int32))


def _require_solid(vertices: Array, where: Where) -> None:
    """Raises `DescriptionError` for what has no thickness in some direction, or the size of no link."""
    longest = float(np.ptp(vertices, axis=0).max())
    if longest > LARGEST:
        raise where.error(because("fit.mesh.long", length=longest))
    if longest < SMALLEST:
        raise where.error(because("fit.mesh.short", length=1000.0 * longest))
    across = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)[2]
    thickness = float(np.ptp(vertices @ across.T, axis=0).min())
    if thickness < FLAT * longest:
        raise where.error(because("fit.mesh.flat", thickness=round(1000.0 * thickness, 6)))
