"""Draw a link's mesh from convex parts with chamfered edges. Needs trimesh and shapely (extra `view`)."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual.material import PBRMaterial

Outline = NDArray[np.float64]  # (n, 2) [m], convex
Parts = list[trimesh.Trimesh]
CORNERS = 28  # points of a full circle
AXES = {"x": 1, "y": 2, "z": 0}  # cyclic: an outline across x has (y, z), across y (z, x), across z (x, y)

CHARCOAL = PBRMaterial(
    name="charcoal", baseColorFactor=[0.16, 0.18, 0.21, 1.0], metallicFactor=0.1, roughnessFactor=0.6
)
WHITE = PBRMaterial(name="white", baseColorFactor=[0.88, 0.89, 0.90, 1.0], metallicFactor=0.0, roughnessFactor=0.5)
STEEL = PBRMaterial(name="steel", baseColorFactor=[0.62, 0.64, 0.67, 1.0], metallicFactor=0.5, roughnessFactor=0.35)
BLACK = PBRMaterial(name="black", baseColorFactor=[0.06, 0.06, 0.07, 1.0], metallicFactor=0.1, roughnessFactor=0.5)


def circle(radius: float, at: tuple[float, float] = (0.0, 0.0)) -> Outline:
    """A circle [m] in the plane."""
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    return np.column_stack((at[0] + radius * np.cos(angle), at[1] + radius * np.sin(angle)))


def rounded(size: tuple[float, float], radius: float, at: tuple[float, float] = (0.0, 0.0)) -> Outline:
    """A rectangle of `size` [m] with rounded corners."""
    x, y = size[0] / 2.0 - radius, size[1] / 2.0 - radius
    return np.vstack([circle(radius, (at[0] + sx * x, at[1] + sy * y)) for sx in (-1, 1) for sy in (-1, 1)])


def tapered(radius: float, at: tuple[float, float], end_radius: float, end: tuple[float, float]) -> Outline:
    """A beam between two round ends."""
    return np.vstack((circle(radius, at), circle(end_radius, end)))


def solid(
    outline: Outline, low: float, high: float, material: PBRMaterial, chamfer: float = 0.002, axis: str = "z"
) -> trimesh.Trimesh:
    """The convex outline from `low` to `high` [m] along `axis`, its edges chamfered."""
    middle = outline.mean(axis=0)
    extent = np.abs(outline - middle).max(axis=0)
    inner = middle + (outline - middle) * (1.0 - chamfer / extent)
    layers = ((inner, low), (outline, low + chamfer), (outline, high - chamfer), (inner, high))
    points = np.vstack([np.column_stack((ring, np.full(len(ring), z))) for ring, z in layers])
    return hull(np.roll(points, AXES[axis], axis=1), material)


def hull(points: NDArray[np.float64], material: PBRMaterial) -> trimesh.Trimesh:
    """The convex hull of the points (n, 3) [m], flat faces flat and round ones smooth."""
    mesh = trimesh.graph.smooth_shade(trimesh.convex.convex_hull(points), angle=np.radians(35.0))
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def joined(parts: Parts) -> trimesh.Scene:
    """One scene with one mesh a material, so that the file holds few nodes."""
    scene = trimesh.Scene()
    for material in {part.visual.material.name: part.visual.material for part in parts}.values():
        same = [part for part in parts if part.visual.material.name == material.name]
        mesh = trimesh.util.concatenate([trimesh.Trimesh(p.vertices, p.faces, process=False) for p in same])
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(mesh, geom_name=material.name, node_name=material.name)
    return scene


def write_meshes(robot: Path, drawings: dict[str, Callable[[], Parts]]) -> None:
    """Write <link>.glb of every drawing to `meshes` of the robot's folder, or to the folder that the command names."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else robot / "meshes"
    folder.mkdir(exist_ok=True)
    for link, draw in drawings.items():
        data = joined(draw()).export(file_type="glb", include_normals=True)
        (folder / f"{link}.glb").write_bytes(data)
        print(f"{link}.glb {len(data) / 1024:.0f} KiB")
