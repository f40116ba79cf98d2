"""The objects of `gemelo scene`: from options to messages in SI units, and from messages to text in millimetres."""

from __future__ import annotations

from collections.abc import Sequence

import gemelo
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because
from gemelo.schemas.scene import (
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    Shape,
    SphereShape,
)
from gemelo.tools.cli.bus.request_text import millimetres, rotation_text
from gemelo.tools.cli.common.errors import usage
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.common.units import LENGTH, parse_quantity, parse_rotation
from gemelo.tools.cli.parser import Options


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
        return _mesh_of(options.mesh, options.scale)
    return PlaneShape()


def _mesh_of(path: str, scale: float | None) -> MeshShape:
    """The mesh of an STL file, `scale` [m] to its unit; raises `CommandError` where it cannot be."""
    try:
        return gemelo.load_mesh(path, scale)
    except gemelo.BadArgument as error:
        raise usage(error) from error


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


def listing(scene: PlanningScene) -> str:
    """A table of the objects, and the pairs that may touch."""
    headings = columns("object", "shape [mm]", "x y z [mm]", "turned", "in", "touches", "padding [mm]")
    rows = [_row(item) for item in scene.objects]
    pairs = [because("understood.scene.pair", first=pair.first, second=pair.second) for pair in scene.allowed]
    lines = [table(headings, rows)] if rows else [sentence(because("understood.scene.empty"))]
    lines += map(sentence, pairs)
    return "\n".join([*lines, sentence(because("understood.scene.number", version=scene.version))])


def _row(item: SceneObject) -> tuple[str, ...]:
    at = " ".join(f"{1000.0 * value:z.1f}" for value in item.pose.translation)
    held = sentence(because("understood.scene.attached", frame=item.frame)) if item.attached else item.frame
    touches = ", ".join(item.touch_links) or "-"
    return (
        item.name,
        shape_text(item.shape),
        at,
        rotation_text(item.pose.rotation),
        held or word("scene", "base"),
        touches,
        f"{1000.0 * item.padding:g}",
    )


def place_text(pose: Transform, frame: str) -> str:
    """A pose in `frame` (empty: the base) as text, lengths in [mm]."""
    rotation = rotation_text(pose.rotation)
    parts = [because("understood.at", position=millimetres(pose.translation))]
    parts += [because("understood.turned", turn=rotation)] if rotation != "-" else []
    parts += [because("understood.frame", frame=frame) if frame else because("understood.base")]
    return ", ".join(map(sentence, parts))


def sized_text(shape: Shape) -> str:
    """The shape as text with its unit; of a mesh with its size, which shows a wrong scale."""
    if isinstance(shape, MeshShape):
        return f"{shape_text(shape)}{_mesh_size(shape)}"
    return f"{shape_text(shape)}{'' if isinstance(shape, PlaneShape) else ' mm'}"


def _mesh_size(shape: MeshShape) -> str:
    """Empty for what is no mesh, which the planner says."""
    from gemelo.libraries.arm.stl import BadStl, read_stl  # slow to load: numpy

    try:
        vertices = read_stl(shape.data or (project_root() / shape.path).read_bytes()).vertices
    except (BadStl, OSError):
        return ""
    edges = (vertices.max(axis=0) - vertices.min(axis=0)) * shape.scale
    size = " x ".join(f"{1000.0 * edge:.3g}" for edge in edges)
    return f", {sentence(because('understood.shape.large', size=size))}"


def shape_text(shape: Shape) -> str:
    """The shape as text, lengths in [mm]."""
    match shape:
        case BoxShape():
            edges = " x ".join(f"{1000.0 * edge:g}" for edge in shape.size)
            return sentence(because("understood.shape.box", edges=edges))
        case SphereShape():
            return sentence(because("understood.shape.sphere", radius=1000.0 * shape.radius))
        case CylinderShape():
            sizes = {"radius": 1000.0 * shape.radius, "length": 1000.0 * shape.length}
            return sentence(because("understood.shape.cylinder", **sizes))
        case PlaneShape():
            return sentence(because("understood.shape.plane"))
        case MeshShape():
            size = len(shape.data) or shape.size
            mesh = because("understood.shape.mesh", file=shape.path) if shape.path else because(
                "understood.shape.mesh.data", size=size
            )  # fmt: skip
            if set(shape.scale) == {1.0}:
                return sentence(mesh)
            return sentence(because("understood.shape.scaled", mesh, scale=shape.scale[0]))
