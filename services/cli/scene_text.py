"""A planning scene as a table for a person, and as a JSON file."""

from __future__ import annotations

from pathlib import Path

import msgspec

from schemas.frames import Transform
from schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, PlanningScene, SceneObject, Shape, SphereShape
from services.cli.errors import CommandError, usage
from services.cli.request_text import millimetres, rotation_text
from services.cli.text_table import table


def listing(scene: PlanningScene) -> str:
    """A table of the objects, and the pairs that may touch."""
    headings = ("object", "shape [mm]", "x y z [mm]", "turned", "in", "touches", "padding [mm]")
    rows = [_row(item) for item in scene.objects]
    lines = [table(headings, rows)] if rows else ["nothing is around the arm"]
    lines += [f"{pair.first} and {pair.second} may touch" for pair in scene.allowed]
    return "\n".join([*lines, f"version {scene.version}"])


def write_scene(scene: PlanningScene, path: Path) -> None:
    """Writes the scene as JSON; raises `CommandError` if the file cannot be written."""
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(scene)) + b"\n")
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}") from error
    print(f"{path} has the scene, version {scene.version}")


def read_scene(path: Path) -> PlanningScene:
    """Reads a scene; raises `CommandError` if the file cannot be read or holds none."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=PlanningScene)
    except OSError as error:
        raise usage(f"{path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise usage(f"{path} holds no scene: {error}") from error


def _row(item: SceneObject) -> tuple[str, ...]:
    at = " ".join(f"{1000.0 * value:z.1f}" for value in item.pose.translation)
    held = f"{item.frame} (attached)" if item.attached else item.frame or "base"
    touches = ", ".join(item.touch_links) or "-"
    return (
        item.name,
        shape_text(item.shape),
        at,
        rotation_text(item.pose.rotation),
        held,
        touches,
        f"{1000.0 * item.padding:g}",
    )


def place_text(pose: Transform, frame: str) -> str:
    """A pose in `frame` (empty: the base) as text, lengths in [mm]."""
    rotation = rotation_text(pose.rotation)
    turned = f", turned {rotation}" if rotation != "-" else ""
    return f"at {millimetres(pose.translation)}{turned}, in {frame or 'the base'}"


def sized_text(shape: Shape) -> str:
    """The shape as text with its unit."""
    return f"{shape_text(shape)}{'' if isinstance(shape, PlaneShape | MeshShape) else ' mm'}"


def shape_text(shape: Shape) -> str:
    """The shape as text, lengths in [mm]."""
    match shape:
        case BoxShape():
            return f"box {' x '.join(f'{1000.0 * edge:g}' for edge in shape.size)}"
        case SphereShape():
            return f"sphere of radius {1000.0 * shape.radius:g}"
        case CylinderShape():
            return f"cylinder of radius {1000.0 * shape.radius:g}, length {1000.0 * shape.length:g}"
        case PlaneShape():
            return "plane, solid below"
        case MeshShape():
            scale = "" if set(shape.scale) == {1.0} else f", scale {shape.scale[0]:g}"
            return f"mesh {shape.path or f'of {len(shape.data)} bytes'}{scale}"
