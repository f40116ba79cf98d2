"""The objects of a planning scene as solids: sizes checked, meshes read."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path, PurePosixPath

import numpy as np

from gemelo.libraries.arm.frames.transforms import BadTransform, Rigid, from_message
from gemelo.libraries.arm.stl import BadStl, read_stl
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import AllowedPair, BoxShape, CylinderShape, MeshShape, PlaneShape, SceneObject, SphereShape
from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind, TriangleMesh

LARGEST_FILE = 32_000_000  # [bytes]; chosen: the 500,000 triangles that a mesh may have are 25 million
Folders = Sequence[Path]

ANY = "*"
# Tuning constants: chosen, where a line does not say measured or standard.
MOST_KNOWN = 2048  # objects whose solids are kept: those of a scene before a change and after it
LARGEST = 1e4  # [m] that a size or a coordinate may have; chosen: more is a number in millimetres


class SceneError(ReasonedError, ValueError):
    """A scene that cannot be; the reason names the object, the value and the remedy."""


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
        would_do = remedy("no_padding")
        raise SceneError(because("scene.object.padding", would_do, object=item.name, value=item.padding))
    kind, size, mesh = _form(item, folders)
    return CollisionShape(item.name, kind, size, pose_of(item), mesh, item.padding)


def pose_of(item: SceneObject) -> Rigid:
    """The object's pose in its frame; raises `SceneError`."""
    try:
        pose = from_message(item.pose)
    except BadTransform as error:
        raise SceneError(because("scene.object.pose", error.reason, remedy("give_pose"), object=item.name)) from None
    if max(map(abs, pose[0])) > LARGEST:
        place = item.pose.translation
        raise SceneError(because("scene.object.far", object=item.name, position=place, limit=LARGEST))
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
        counts = {"needed": len(names), "count": len(values)}
        raise SceneError(because("scene.shape.count", object=name, kind=what, sizes=tuple(names), **counts))
    for called, value in zip(names, values, strict=True):
        if not 0.0 < value <= LARGEST:
            named = {"object": name, "size": called, "kind": what}
            raise SceneError(because("scene.shape.size", remedy("more_than_nothing"), **named, value=value))
    return values


def _mesh(name: str, shape: MeshShape, folders: Folders) -> TriangleMesh:
    if len(shape.scale) != 3 or not all(0.0 < abs(factor) <= LARGEST for factor in shape.scale):
        would_do = remedy("three_numbers")
        raise SceneError(because("scene.mesh.scale", would_do, object=name, scale=tuple(shape.scale)))
    x, y, z = shape.scale
    try:
        return _triangles(_content(name, shape, folders), (x, y, z))
    except BadStl as error:
        if shape.path:
            raise SceneError(because("scene.mesh.file", error.reason, object=name, path=shape.path)) from None
        raise SceneError(because("scene.mesh.data", error.reason, object=name)) from None


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
            would_do = remedy("add_with_file")
            raise SceneError(because("scene.mesh.unknown", would_do, object=name, digest=shape.digest))
        if len(shape.data) > LARGEST_FILE:
            either, size = (remedy("simplify_it"), remedy("binary_stl")), len(shape.data)
            raise SceneError(because("scene.mesh.large", *either, object=name, size=size, limit=LARGEST_FILE))
        return shape.data
    relative = PurePosixPath(shape.path)
    if relative.is_absolute() or ".." in relative.parts:
        either = remedy("relative_path"), remedy("give_content")
        raise SceneError(because("scene.mesh.elsewhere", *either, object=name, path=shape.path))
    for folder in folders:
        if _is_file(folder / relative):
            return _read(name, folder / relative)
    looked = tuple(str(folder) for folder in folders)
    raise SceneError(because("scene.mesh.none", object=name, path=shape.path, folders=looked))


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
        detail = error.strerror or str(error)
        raise SceneError(because("scene.mesh.unreadable", object=name, path=str(path), detail=detail)) from None
