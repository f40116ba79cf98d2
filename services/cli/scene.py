"""`gemelo scene`: what stands around the arm, and what it carries."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from schemas.message import Vector
from schemas.scene import (
    BoxShape,
    CylinderShape,
    MeshShape,
    PlaneShape,
    PlanningScene,
    SceneObject,
    SceneRequest,
    SceneResponse,
    Shape,
    SphereShape,
)
from schemas.topics import SCENE, SCENE_EDIT
from services.cli.columns import table
from services.cli.exits import CommandError, ExitCode, usage

if TYPE_CHECKING:
    from services.cli.session import Session

PATIENCE = 10.0  # [s] a mesh of many triangles takes the planner some
LATCHED_WAIT = 1.0  # [s] for a scene that is there already


def edit(session: Session, request: SceneRequest) -> ExitCode:
    """Asks for the change; a refusal is raised with its reason."""
    response: SceneResponse = session.node.call(SCENE_EDIT, request, timeout=PATIENCE)
    if not response.accepted:
        raise CommandError(f"refused: {response.reason}")
    print(f"scene version {response.version}{f': {response.reason}' if response.reason else ''}")
    return ExitCode.OK


def present(session: Session) -> PlanningScene:
    """The scene as the planner published it last."""
    scene = session.node.latest(SCENE)
    until = session.node.monotonic() + LATCHED_WAIT
    while scene.message is None and session.node.monotonic() < until:
        session.node.wait(0.02)
    if scene.message is None:
        raise CommandError("nobody publishes a scene: is the planner running?", ExitCode.NO_STACK)
    return scene.message


def listing(scene: PlanningScene) -> str:
    """A table of the objects, and the pairs that may touch."""
    headings = ("object", "shape [mm]", "x y z [mm]", "turned", "in", "touches", "padding [mm]")
    rows = [_row(item) for item in scene.objects]
    lines = [table(headings, rows)] if rows else ["nothing is around the arm"]
    lines += [f"{pair.first} and {pair.second} may touch" for pair in scene.allowed]
    return "\n".join([*lines, f"version {scene.version}"])


def save(scene: PlanningScene, path: Path) -> None:
    """Writes the scene as JSON."""
    try:
        path.write_bytes(msgspec.json.format(msgspec.json.encode(scene)) + b"\n")
    except OSError as error:
        raise CommandError(f"{path} cannot be written: {error.strerror}") from error
    print(f"{path} has the scene, version {scene.version}")


def load(path: Path) -> PlanningScene:
    """The scene of a file."""
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
        turn_text(item.pose.rotation),
        held,
        touches,
        f"{1000.0 * item.padding:g}",
    )


def turn_text(rotation: Vector) -> str:
    """How far [deg] and about which axis an object (x, y, z, w) is turned."""
    sine = math.hypot(*rotation[:3])
    angle = math.degrees(2.0 * math.atan2(sine, rotation[3]))
    if abs(angle) < 0.05:
        return "-"
    return f"{angle:.1f} deg about {' '.join(f'{value / sine:z.2f}' for value in rotation[:3])}"


def shape_text(shape: Shape) -> str:
    """The shape in words, in mm."""
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
