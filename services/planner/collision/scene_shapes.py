"""The objects of a planning scene as solids: sizes checked, meshes read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path, PurePosixPath

import numpy as np

from gemelo.libraries.arm.frames.transforms import Rigid, from_message
from gemelo.libraries.arm.stl import BadStl, read_stl
from gemelo.schemas.message import Vector
from gemelo.schemas.scene import AllowedPair, BoxShape, CylinderShape, MeshShape, PlaneShape, SceneObject, SphereShape
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh

LARGEST_FILE = 32_000_000  # [bytes]; chosen: the 500,000 triangles that a mesh may have are 25 million
Folders = Sequence[Path]

ANY = "*"
# Tuning constants: chosen, where a line does not say measured or standard.
MOST_KNOWN = 2048  # objects whose solids are kept: those of a scene before a change and after it
LARGEST = 1e4  # [m] that a size or a coordinate may have; chosen: more is a number in millimetres


class SceneError(ValueError):
    """A scene that cannot be; the text names the object, the value and the remedy."""


def shape_of(item: SceneObject, folders: Folders = ()) -> CollisionShape:
    """The object as a solid, its pose in its own frame; mesh files are looked for in `folders`. Raises `SceneError`.

    Of an equal object the same solid, but of one whose file may have changed.
    """
    return _shape_of(item, folders) if is_read_from_a_file(item) else _known(item)


def is_read_from_a_file(item: SceneObject) -> bool:
    """True for a mesh whose content is not in the message."""
    return isinstance(item.shape, MeshShape) and bool(item.shape.path)


@lru_cache(maxsize=MOST_KNOWN)
def _known(item: SceneObject) -> CollisionShape:
    return _shape_of(item, ())


def _shape_of(item: SceneObject, folders: Folders) -> CollisionShape:
    if not 0.0 <= item.padding <= LARGEST:
        raise SceneError(f'object "{item.name}": padding is {item.padding:g} m; give 0 m or more')
    kind, size, mesh = _form(item, folders)
    return CollisionShape(item.name, kind, size, pose_of(item), mesh, item.padding)


def pose_of(item: SceneObject) -> Rigid:
    """The object's pose in its frame; raises `SceneError`."""
    try:
        pose = from_message(item.pose)
    except ValueError as error:
        raise SceneError(f'object "{item.name}": {error}; give x y z in m and a unit quaternion x y z w') from None
    if max(map(abs, pose[0])) > LARGEST:
        raise SceneError(f'object "{item.name}" is at {item.pose.translation} m, beyond {LARGEST:g} m: is that in mm?')
    return pose


def allows(pairs: Iterable[AllowedPair], first: str, second: str) -> bool:
    """True if one of the pairs lets these two touch, in either order; "*" is any name."""
    return any(
        (pair.first in (one, ANY) and pair.second in (other, ANY))
        for pair in pairs
        for one, other in ((first, second), (second, first))
    )


def _form(item: SceneObject, folders: Folders) -> tuple[ShapeKind, tuple[float, ...], TriangleMesh | None]:
    match item.shape:
        case BoxShape(size=edges):
            return ShapeKind.BOX, _sizes(item.name, "box", ("x", "y", "z"), edges), None
        case SphereShape(radius=radius):
            return ShapeKind.SPHERE, _sizes(item.name, "sphere", ("radius",), (radius,)), None
        case CylinderShape(radius=radius, length=length):
            names = ("radius", "length")
            return ShapeKind.CYLINDER, _sizes(item.name, "cylinder", names, (radius, length)), None
        case PlaneShape():
            return ShapeKind.HALF_SPACE, (), None
        case MeshShape():
            return ShapeKind.MESH, (), _mesh(item.name, item.shape, folders)


def _sizes(name: str, what: str, names: Sequence[str], values: Vector) -> Vector:
    if len(values) != len(names):
        raise SceneError(f'object "{name}": a {what} has {len(names)} sizes ({", ".join(names)}), not {len(values)}')
    for called, value in zip(names, values, strict=True):
        if not 0.0 < value <= LARGEST:
            raise SceneError(f'object "{name}": {called} of the {what} is {value:g} m; give more than 0 m')
    return values


def _mesh(name: str, shape: MeshShape, folders: Folders) -> TriangleMesh:
    if len(shape.scale) != 3 or not all(0.0 < abs(factor) <= LARGEST for factor in shape.scale):
        raise SceneError(f'object "{name}": scale of the mesh is {shape.scale}; give three numbers that are not 0')
    x, y, z = shape.scale
    try:
        return _triangles(_content(name, shape, folders), (x, y, z))
    except BadStl as error:
        what = f'"{shape.path}"' if shape.path else "its data"
        raise SceneError(f'object "{name}": {what} is no usable STL file: {error}') from None


@lru_cache(maxsize=64)
def _triangles(content: bytes, scale: tuple[float, float, float]) -> TriangleMesh:
    """Of equal content the same mesh, so that what is built of it is built once."""
    triangles = read_stl(content)
    inside_out = scale[0] * scale[1] * scale[2] < 0.0
    faces = triangles.faces[:, ::-1] if inside_out else triangles.faces
    return TriangleMesh(triangles.vertices * np.array(scale), np.ascontiguousarray(faces))


def _content(name: str, shape: MeshShape, folders: Folders) -> bytes:
    if not shape.path:
        if shape.digest and not shape.data:
            raise SceneError(f'object "{name}": nothing is known of its mesh {shape.digest}; add it with its file')
        if len(shape.data) > LARGEST_FILE:
            raise SceneError(
                f'object "{name}": its mesh has {len(shape.data)} bytes, more than {LARGEST_FILE}; simplify it, or '
                "write it as a binary STL file"
            )
        return shape.data
    relative = PurePosixPath(shape.path)
    if relative.is_absolute() or ".." in relative.parts:
        raise SceneError(
            f'object "{name}": mesh path "{shape.path}" leads elsewhere; give one relative to the project or to the '
            "robot's folder, or the file's content"
        )
    for folder in folders:
        if _is_file(folder / relative):
            return _read(name, folder / relative)
    looked = " and ".join(str(folder) for folder in folders) or "no folder"
    raise SceneError(f'object "{name}": there is no mesh "{shape.path}" in {looked}')


def _is_file(path: Path) -> bool:
    """False also for a path that no file system can have: too long a name, for example."""
    try:
        return path.is_file()
    except OSError:
        return False


def _read(name: str, path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise SceneError(f'object "{name}": mesh {path} cannot be read: {error.strerror}') from None
