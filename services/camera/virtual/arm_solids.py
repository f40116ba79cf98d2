"""The arm as the virtual camera draws it: the collision shapes of its URDF, link by link."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, from_rpy
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.stl import BadStl, read_stl
from gemelo.schemas.scene import BoxShape, CylinderShape, MeshShape, PlaneShape, Shape, SphereShape
from gemelo.services.camera.virtual.solids import Array, Colour, PosedSolid, box, cylinder, sphere, triangles

LINKS: tuple[Colour, ...] = ((196, 198, 202), (70, 72, 78), (150, 154, 160))  # one after the other
MOST_TRIANGLES = 2000  # of a mesh; of a larger one its bounding box is drawn


def arm_solids(arm: ArmDescription) -> dict[str, tuple[PosedSolid, ...]]:
    """Solids in the frame of each link; meshes that are not STL are left out. Raises `DescriptionError`."""
    try:
        root = ET.parse(arm.urdf_path).getroot()
    except (OSError, ET.ParseError) as error:
        raise DescriptionError(f"{arm.urdf_path}: {error}") from error
    found = {}
    for number, link in enumerate(root.findall("link")):
        shapes = [(shape_of(each), _origin(each)) for each in link.findall("collision")]
        colour = LINKS[number % len(LINKS)]
        solids = [solid_of(shape, colour, pose, arm.folder) for shape, pose in shapes if shape is not None]
        found[link.get("name", "")] = tuple(solid for solid in solids if solid is not None)
    return found


def shape_of(collision: ET.Element) -> Shape | None:
    """The shape of a <collision>; None for one that cannot be drawn."""
    for element in collision.findall("geometry/*"):
        match element.tag:
            case "box":
                return BoxShape(size=_numbers(element, "size"))
            case "cylinder":
                return CylinderShape(radius=float(element.get("radius", 0)), length=float(element.get("length", 0)))
            case "sphere":
                return SphereShape(radius=float(element.get("radius", 0)))
            case "mesh":
                scale = _numbers(element, "scale") or (1.0, 1.0, 1.0)
                return MeshShape(path=element.get("filename", ""), scale=scale)
    return None


def solid_of(shape: Shape, colour: Colour, pose: Rigid, *folders: Path) -> PosedSolid | None:
    """A shape of the planning scene or of a link; a mesh's path is relative to one of `folders`."""
    match shape:
        case BoxShape(size=(x, y, z)):
            return box((x, y, z), colour, pose)
        case CylinderShape():
            return cylinder(shape.radius, shape.length, colour, pose)
        case SphereShape():
            return sphere(shape.radius, colour, pose)
        case MeshShape():
            return _mesh(shape, colour, pose, folders)
        case BoxShape() | PlaneShape():
            return None


def _mesh(shape: MeshShape, colour: Colour, pose: Rigid, folders: Sequence[Path]) -> PosedSolid | None:
    found = next((folder / shape.path for folder in folders if shape.path and (folder / shape.path).is_file()), None)
    try:
        mesh = read_stl(found.read_bytes() if found is not None else shape.data)
    except (BadStl, OSError):
        return None
    vertices: Array = mesh.vertices * np.array(shape.scale)
    if len(mesh.faces) <= MOST_TRIANGLES:
        return triangles(vertices, mesh.faces, colour, pose)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y, z = ((low + high) / 2.0).tolist()
    a, b, c = (high - low).tolist()
    inner = box((a, b, c), colour)
    return PosedSolid(tuple(face.moved((x, y, z)) for face in inner.faces), pose)


def _origin(element: ET.Element) -> Rigid:
    origin = element.find("origin")
    if origin is None:
        return IDENTITY
    x, y, z = _numbers(origin, "xyz") or (0.0, 0.0, 0.0)
    roll, pitch, yaw = _numbers(origin, "rpy") or (0.0, 0.0, 0.0)
    return (x, y, z), from_rpy(roll, pitch, yaw)


def _numbers(element: ET.Element, key: str) -> tuple[float, ...]:
    return tuple(float(word) for word in element.get(key, "").split())
