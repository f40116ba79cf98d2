"""Draw parol6: one small GLB a link, from convex parts with chamfered edges. Needs trimesh and shapely (extra `view`).

Our own shapes, within the published sizes of the links; nothing is taken from the arm's published meshes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual.material import PBRMaterial

Outline = NDArray[np.float64]  # (n, 2) [m], convex
Parts = list[trimesh.Trimesh]
MESHES = Path(__file__).parent / "meshes"
CORNERS = 28  # points of a full circle
AXES = {"x": 1, "y": 2, "z": 0}  # cyclic: an outline across x has (y, z), across y (z, x), across z (x, y)

CHARCOAL = PBRMaterial(
    name="charcoal", baseColorFactor=[0.16, 0.18, 0.21, 1.0], metallicFactor=0.1, roughnessFactor=0.6
)
TEAL = PBRMaterial(name="teal", baseColorFactor=[0.06, 0.52, 0.53, 1.0], metallicFactor=0.1, roughnessFactor=0.45)
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


def beam(radius: float, start: tuple[float, float], end: tuple[float, float]) -> Outline:
    """A strip between two round ends."""
    return np.vstack((circle(radius, start), circle(radius, end)))


def solid(
    outline: Outline, low: float, high: float, material: PBRMaterial, chamfer: float = 0.002, axis: str = "z"
) -> trimesh.Trimesh:
    """The convex outline from `low` to `high` [m] along `axis`, edges chamfered, flat faces flat, round ones smooth."""
    middle = outline.mean(axis=0)
    extent = np.abs(outline - middle).max(axis=0)
    inner = middle + (outline - middle) * (1.0 - chamfer / extent)
    layers = ((inner, low), (outline, low + chamfer), (outline, high - chamfer), (inner, high))
    points = np.vstack([np.column_stack((ring, np.full(len(ring), z))) for ring, z in layers])
    turned = np.roll(points, AXES[axis], axis=1)
    mesh = trimesh.graph.smooth_shade(trimesh.convex.convex_hull(turned), angle=np.radians(35.0))
    mesh.visual = trimesh.visual.TextureVisuals(material=material)
    return mesh


def motor(at: tuple[float, float], low: float, high: float, axis: str) -> Parts:
    """A NEMA17: black, with steel ends."""
    end = 0.009
    return [
        solid(rounded((0.0423, 0.0423), 0.005, at), low, low + end, STEEL, 0.001, axis),
        solid(rounded((0.0423, 0.0423), 0.007, at), low + end, high - end, BLACK, 0.001, axis),
        solid(rounded((0.0423, 0.0423), 0.005, at), high - end, high, STEEL, 0.001, axis),
    ]


def base() -> Parts:
    """Foot, the housing of joint_1's motor behind, and the round one under the turret."""
    return [
        solid(rounded((0.227, 0.125), 0.02, (-0.0385, 0.0)), 0.0, 0.014, CHARCOAL),
        solid(rounded((0.110, 0.096), 0.016, (-0.088, 0.0)), 0.014, 0.058, WHITE, 0.004),
        solid(rounded((0.060, 0.060), 0.010, (-0.108, 0.0)), 0.058, 0.070, CHARCOAL),
        solid(circle(0.0605), 0.014, 0.060, WHITE, 0.003),
        solid(circle(0.058), 0.060, 0.064, TEAL, 0.001),
        solid(circle(0.0605), 0.064, 0.0705, CHARCOAL, 0.001),
    ]


def turret() -> Parts:
    """Turntable, tower, and across it the shaft and the motor of joint_2."""
    shoulder = (0.1105, 0.02342)  # z, x: an outline across y
    return [
        solid(circle(0.057), 0.0715, 0.084, STEEL),
        solid(rounded((0.120, 0.090), 0.018), 0.082, 0.150, TEAL, 0.005),
        solid(rounded((0.096, 0.066), 0.014), 0.150, 0.1565, CHARCOAL),
        solid(circle(0.016, shoulder), -0.066, 0.066, STEEL, 0.001, "y"),
        solid(circle(0.027, shoulder), -0.107, -0.064, CHARCOAL, 0.003, "y"),
        *motor(shoulder, 0.064, 0.131, "y"),
    ]


def upper_arm() -> Parts:
    """Two plates with the pins of the elbow, their brace, and the motor of joint_3 on the back of one."""
    plate = beam(0.030, (0.0, 0.0), (0.180, 0.0))
    return [
        solid(plate, -0.061, -0.052, WHITE),
        solid(plate, 0.052, 0.061, WHITE),
        solid(beam(0.016, (0.060, 0.0), (0.140, 0.0)), 0.060, 0.062, TEAL, 0.0005),
        solid(beam(0.016, (0.060, 0.0), (0.140, 0.0)), -0.062, -0.060, TEAL, 0.0005),
        *[solid(circle(0.012, (0.180, 0.0)), low, low + 0.024, STEEL, 0.001) for low in (-0.0545, 0.0305)],
        solid(rounded((0.030, 0.027), 0.006, (0.055, -0.0335)), -0.0525, 0.0525, CHARCOAL),
        *motor((0.061, -0.026), 0.062, 0.131, "z"),
    ]


def elbow() -> Parts:
    """The block that turns between the plates and carries the forearm."""
    return [
        solid(rounded((0.107, 0.102), 0.024, (-0.0265, -0.004)), -0.0285, 0.0285, TEAL, 0.005),
        solid(rounded((0.080, 0.075), 0.018, (-0.0265, -0.004)), -0.0310, 0.0310, CHARCOAL, 0.002),
        solid(circle(0.022), -0.0325, 0.0325, STEEL, 0.001),
    ]


def forearm() -> Parts:
    """Shaft, round body, and the fork that holds the wrist."""
    arm = beam(0.017, (-0.17635, 0.0), (-0.099, 0.0))  # z, x: an outline across y
    return [
        solid(circle(0.025), -0.052, 0.00065, STEEL),
        solid(circle(0.0425), -0.094, -0.050, WHITE, 0.004),
        solid(circle(0.0430), -0.072, -0.064, TEAL, 0.0005),
        solid(circle(0.0425), -0.101, -0.092, CHARCOAL),
        solid(arm, 0.033, 0.046, WHITE, 0.002, "y"),
        solid(arm, -0.046, -0.033, WHITE, 0.002, "y"),
    ]


def wrist() -> Parts:
    """The hub in the fork, its shaft, and the flange that joint_6 turns on."""
    return [
        solid(rounded((0.057, 0.047), 0.008, (0.0, -0.0077)), -0.030, 0.030, CHARCOAL, 0.003),
        solid(circle(0.012), -0.049, 0.049, STEEL, 0.001),
        solid(circle(0.025), 0.014, 0.0225, STEEL, 0.001, "y"),
    ]


def hand() -> Parts:
    """From the axis of joint_6 over to the tool, 45.25 mm beside it; z points back to the wrist."""
    return [
        solid(rounded((0.082, 0.058), 0.018, (-0.0226, 0.0)), -0.050, -0.0235, TEAL, 0.004),
        solid(circle(0.0182), -0.054, -0.049, CHARCOAL, 0.001),
        solid(circle(0.0175, (-0.04525, 0.0)), -0.060, -0.049, STEEL, 0.001),
        solid(circle(0.009, (-0.04525, 0.0)), -0.0628, -0.059, BLACK, 0.001),
    ]


def joined(parts: Parts) -> trimesh.Scene:
    """One scene with one mesh a material, so that the file holds few nodes."""
    scene = trimesh.Scene()
    for material in {part.visual.material.name: part.visual.material for part in parts}.values():
        same = [part for part in parts if part.visual.material.name == material.name]
        mesh = trimesh.util.concatenate([trimesh.Trimesh(p.vertices, p.faces, process=False) for p in same])
        mesh.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(mesh, geom_name=material.name, node_name=material.name)
    return scene


def main() -> None:
    """Write meshes/<link>.glb."""
    MESHES.mkdir(exist_ok=True)
    links = (turret, upper_arm, elbow, forearm, wrist, hand)
    drawings = {"base_link": base, **{f"link_{number}": draw for number, draw in enumerate(links, 1)}}
    for link, draw in drawings.items():
        data = joined(draw()).export(file_type="glb", include_normals=True)
        (MESHES / f"{link}.glb").write_bytes(data)
        print(f"{link}.glb {len(data) / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
