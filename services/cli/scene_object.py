"""The options of `gemelo scene` turned into a scene object: shape, pose and frame, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from schemas.frames import Transform
from schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, SceneObject, Shape, SphereShape
from services.arm.frames.transforms import from_rpy
from services.cli.errors import usage
from services.cli.parser import Options
from services.cli.units import LENGTH, parse_quantity, parse_rotation
from services.runtime.deployment import project_root

LARGEST_MESH = 10.0  # [m]; what is larger was drawn in mm


def object_of(options: Options) -> SceneObject:
    """The object that the options of `scene add` describe."""
    link = options.attach or ""
    return SceneObject(
        name=options.name,
        shape=shape_of(options),
        pose=pose_of(options.at, options.rpy),
        frame=link or options.frame,
        attached=bool(link),
        touch_links=tuple(options.touch),
        padding=length(options.padding, "--padding"),
    )


def shape_of(options: Options) -> Shape:
    """The shape that the options give; raises `CommandError` for a mesh that cannot be."""
    if options.box is not None:
        return BoxShape(size=lengths(options.box, "--box"))
    if options.sphere is not None:
        return SphereShape(radius=length(options.sphere, "--sphere"))
    if options.cylinder is not None:
        radius, long = lengths(options.cylinder, "--cylinder")
        return CylinderShape(radius=radius, length=long)
    if options.mesh is not None:
        return mesh_of(Path(options.mesh), options.scale)
    return PlaneShape()


def mesh_of(path: Path, scale: float) -> MeshShape:
    """The mesh of an STL file: by path inside the project, where every process finds it, else by content.

    `scale` is [m] for each unit of the file. Raises `CommandError` if the file cannot be read or is far too large.
    """
    if not path.is_file():
        raise usage(f'there is no file "{path}"')
    _require_size(path, scale)
    inside = path.resolve()
    if inside.is_relative_to(project_root()):
        return MeshShape(path=str(inside.relative_to(project_root())), scale=(scale,) * 3)
    try:
        return MeshShape(data=path.read_bytes(), scale=(scale,) * 3)
    except OSError as error:
        raise usage(f'"{path}" cannot be read: {error.strerror}') from error


def _require_size(path: Path, scale: float) -> None:
    """Raises `CommandError` for a mesh longer than `LARGEST_MESH`; the planner refuses files that are no mesh."""
    from services.arm.stl import BadStl, read_stl

    try:
        vertices = read_stl(path.read_bytes()).vertices
    except (BadStl, OSError):
        return
    longest = scale * float((vertices.max(axis=0) - vertices.min(axis=0)).max())
    if longest > LARGEST_MESH:
        raise usage(f'"{path}" would be {longest:.4g} m long: if it is drawn in mm, give --scale 0.001')


def pose_of(at: Sequence[str], rpy: Sequence[str]) -> Transform:
    """The pose of a position and of roll, pitch, yaw about the frame's fixed axes."""
    x, y, z = lengths(at, "--at")
    return Transform(translation=(x, y, z), rotation=from_rpy(*(parse_rotation(text, "--rpy") for text in rpy)))


def lengths(texts: Sequence[str], owner: str) -> tuple[float, ...]:
    """Lengths [m]; raises `CommandError` naming the option `owner`."""
    return tuple(length(text, owner) for text in texts)


def length(text: str, owner: str) -> float:
    """A length [m]; raises `CommandError` naming the option `owner`."""
    return parse_quantity(text, LENGTH, owner)
