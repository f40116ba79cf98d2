"""The planning scene in the browser: its objects, what touches, and where a click meets a surface."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from gemelo.libraries.arm.stl import BadStl, read_stl
from gemelo.schemas.frames import Transform
from gemelo.schemas.scene import BoxShape, Contact, CylinderShape, MeshShape, SceneObject, SphereShape

Array = NDArray[np.float64]

PLANE = (2.0, 2.0, 0.002)  # [m] as much of a plane as is drawn
STANDING, CARRIED, TOUCHING = (150, 160, 175), (90, 170, 110), (215, 60, 50)
DOT = 0.008  # [m] radius of a contact
NodeOf = Callable[[str], str]  # the scene's node that moves with a link


class DrawnObstacles:
    """Draws what has changed only; `folders` are where mesh files are looked for."""

    def __init__(self, server: viser.ViserServer, folders: Sequence[Path]) -> None:
        self._server, self._folders = server, tuple(folders)
        self._drawn: dict[str, tuple[SceneObject, viser.MeshHandle]] = {}
        self._meshes: dict[str, trimesh.Trimesh] = {}
        self._items: tuple[SceneObject, ...] = ()
        self.red: frozenset[str] = frozenset()
        self._contacts: tuple[Contact, ...] = ()
        self._dots: list[viser.SceneNodeHandle] = []

    def show(self, items: Sequence[SceneObject], contacts: Sequence[Contact], node_of: NodeOf) -> None:
        """The scene's objects and the jaws, those in `contacts` red; carried ones hang on their link."""
        if tuple(items) == self._items and tuple(contacts) == self._contacts:
            return
        red = frozenset(name for contact in contacts for name in (contact.first, contact.second))
        present = {item.name: item for item in items}
        for name in [name for name, (item, _) in self._drawn.items() if self._is_stale(item, present.get(name), red)]:
            self._drawn.pop(name)[1].remove()
        for name, item in present.items():
            if name not in self._drawn:
                self._draw(item, name in red, f"{node_of(item.frame)}/carried" if item.attached else "/scene")
        self._items, self.red = tuple(items), red
        self._show_contacts(tuple(contacts))

    def under_the_cursor(self, origin: Array, direction: Array) -> Array | None:
        """(3,) [m] where a ray from `origin` (3,) [m] along `direction` (3,) first meets an object or the ground z = 0;
        None if it meets nothing."""
        hits = [_ground(origin, direction)]
        for name, (item, handle) in self._drawn.items():
            if name in self._meshes and not item.attached:
                pose = _matrix(handle)
                corners = trimesh.transform_points(self._meshes[name].vertices, pose)[self._meshes[name].faces]
                hits.append(nearest_hit(origin, direction, corners))
        distances = [distance for distance in hits if np.isfinite(distance)]
        return origin + min(distances) * direction if distances else None

    def _is_stale(self, drawn: SceneObject, item: SceneObject | None, red: frozenset[str]) -> bool:
        return drawn != item or (drawn.name in red) != (drawn.name in self.red)

    def _draw(self, item: SceneObject, is_red: bool, below: str) -> None:
        mesh = self._mesh(item)
        color = TOUCHING if is_red else CARRIED if item.attached else STANDING
        handle = self._server.scene.add_mesh_simple(
            f"{below}/{abs(hash(item.name))}", mesh.vertices, mesh.faces, color=color, flat_shading=True,
            opacity=0.95 if not item.attached else 0.8,
        )  # fmt: skip
        self._meshes[item.name] = mesh
        pose = matrix_of(item.pose)
        handle.wxyz, handle.position = viser.transforms.SO3.from_matrix(pose[:3, :3]).wxyz, pose[:3, 3]
        self._drawn[item.name] = (item, handle)

    def _show_contacts(self, contacts: tuple[Contact, ...]) -> None:
        if contacts == self._contacts:
            return
        self._contacts = contacts
        for dot in self._dots:
            dot.remove()  # with the names on it
        self._dots = []
        for number, contact in enumerate(contacts):
            if len(contact.point) == 3:
                node, (x, y, z) = f"/contacts/{number}", contact.point
                self._dots.append(self._server.scene.add_icosphere(node, DOT, TOUCHING, position=(x, y, z)))
                self._server.scene.add_label(f"{node}/names", f"{contact.first} · {contact.second}", visible=True)

    def _mesh(self, item: SceneObject) -> trimesh.Trimesh:
        match item.shape:
            case BoxShape(size=size):
                return trimesh.creation.box(extents=size)
            case SphereShape(radius=radius):
                return trimesh.creation.icosphere(subdivisions=3, radius=radius)
            case CylinderShape(radius=radius, length=length):
                return trimesh.creation.cylinder(radius=radius, height=length, sections=48)
            case MeshShape():
                return _loaded(item.shape, self._folders)
        below = np.eye(4)
        below[2, 3] = -PLANE[2] / 2.0
        return trimesh.creation.box(extents=PLANE, transform=below)


def _loaded(shape: MeshShape, folders: Sequence[Path]) -> trimesh.Trimesh:
    """The file's triangles in m; a small cube where it cannot be read, which the planner has said already."""
    try:
        paths = [folder / shape.path for folder in folders if shape.path]
        found = next((path for path in paths if path.is_file()), None)
        triangles = read_stl(found.read_bytes() if found is not None else shape.data)
    except (BadStl, OSError):
        return trimesh.creation.box(extents=(0.02, 0.02, 0.02))
    return trimesh.Trimesh(triangles.vertices * np.array(shape.scale), triangles.faces, process=False)


def matrix_of(transform: Transform) -> Array:
    """(4, 4) of the message; it stands at the origin where its numbers are missing."""
    pose = np.eye(4)
    if len(transform.translation) == 3 and len(transform.rotation) == 4:
        x, y, z, w = transform.rotation
        pose[:3, :3] = viser.transforms.SO3(np.array((w, x, y, z))).as_matrix()
        pose[:3, 3] = transform.translation
    return pose


def _matrix(handle: viser.MeshHandle) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = viser.transforms.SO3(np.asarray(handle.wxyz)).as_matrix()
    pose[:3, 3] = handle.position
    return pose


def _ground(origin: Array, direction: Array) -> float:
    """[m] along the ray to z = 0, inf where it goes upwards."""
    return float(-origin[2] / direction[2]) if direction[2] < -1e-9 and origin[2] > 0.0 else np.inf


def nearest_hit(origin: Array, direction: Array, corners: Array) -> float:
    """[m] along the ray from `origin` (3,) in `direction` (3,) to the nearest of the triangles `corners` (t, 3, 3), inf
    for none (Moeller and Trumbore, 1997)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / determinant
        away = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", away, across) * inverse
        turned = np.cross(away, first)
        v = turned @ direction * inverse
        distance = np.einsum("ij,ij->i", second, turned) * inverse
        inside = (np.abs(determinant) > 1e-12) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)
    return float(distance[inside].min()) if inside.any() else np.inf
