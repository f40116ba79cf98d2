"""Draw rm1: one small GLB a link. From the project's folder: `python -m urdf.rm1.make_meshes`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual.material import PBRMaterial

from urdf.drawing import (
    BLACK,
    CHARCOAL,
    CORNERS,
    STEEL,
    WHITE,
    Parts,
    circle,
    hull,
    rounded,
    solid,
    tapered,
    write_meshes,
)

ORANGE = PBRMaterial(name="orange", baseColorFactor=[0.93, 0.43, 0.10, 1.0], metallicFactor=0.1, roughnessFactor=0.45)
BRASS = PBRMaterial(name="brass", baseColorFactor=[0.80, 0.62, 0.26, 1.0], metallicFactor=0.5, roughnessFactor=0.35)


def screws(centres: list[tuple[float, float]], low: float, high: float) -> Parts:
    """Screw heads of 6 mm."""
    return [solid(circle(0.003, centre)[::3], low, high, BLACK, 0.0004) for centre in centres]


def square(half: float, at: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, float]]:
    """The four corners of a square."""
    return [(at[0] + x * half, at[1] + y * half) for x in (-1, 1) for y in (-1, 1)]


def base() -> Parts:
    """Plate, housing of the NEMA23 and its gearbox, and the bearing ring that the arm turns on."""
    return [
        solid(rounded((0.18, 0.18), 0.02), 0.0, 0.012, CHARCOAL),
        solid(circle(0.062), 0.012, 0.070, WHITE, 0.003),
        solid(circle(0.0585), 0.070, 0.074, ORANGE, 0.001),
        solid(circle(0.062), 0.074, 0.086, CHARCOAL),
        solid(circle(0.050), 0.086, 0.088, STEEL, 0.0005),
        solid(rounded((0.03, 0.034), 0.004, (-0.068, 0.0)), 0.012, 0.050, CHARCOAL),
        *screws(square(0.076), 0.012, 0.016),
    ]


def upper_arm() -> Parts:
    """Shoulder hub, beam, elbow hub, and the elbow's NEMA17 hanging below it."""
    elbow = (0.20188, -0.00037)
    return [
        solid(circle(0.046), 0.090, 0.104, STEEL),
        solid(tapered(0.046, (0.0, 0.0), 0.0375, elbow), 0.102, 0.144, ORANGE, 0.004),
        solid(circle(0.034), 0.144, 0.148, CHARCOAL, 0.001),
        solid(circle(0.012), 0.148, 0.151, STEEL, 0.001),
        solid(circle(0.030, elbow), 0.144, 0.1495, STEEL, 0.001),
        solid(rounded((0.0423, 0.0423), 0.005, elbow), 0.093, 0.102, STEEL, 0.001),
        solid(rounded((0.0423, 0.0423), 0.007, elbow), 0.063, 0.093, BLACK, 0.001),
        solid(rounded((0.0423, 0.0423), 0.005, elbow), 0.055, 0.063, STEEL, 0.001),
        *screws([(0.024, 0.024), (0.024, -0.024), (-0.024, 0.024), (-0.024, -0.024)], 0.144, 0.1465),
    ]


def forearm() -> Parts:
    """The box of 252 x 77 x 64 mm, its cover, the tool's guide and the NEMA17 of the rack."""
    return [
        solid(circle(0.030), 0.0, 0.004, STEEL, 0.001),
        solid(rounded((0.252, 0.077), 0.030, (0.0875, 0.001)), 0.003, 0.055, WHITE, 0.004),
        solid(rounded((0.244, 0.069), 0.027, (0.0875, 0.001)), 0.055, 0.067, CHARCOAL, 0.003),
        solid(rounded((0.030, 0.055), 0.006, (0.2015, 0.001)), 0.002, 0.0685, ORANGE, 0.002),
        solid(rounded((0.0423, 0.0423), 0.005, (0.150, 0.001)), 0.067, 0.075, STEEL, 0.001),
        solid(rounded((0.0423, 0.0423), 0.007, (0.150, 0.001)), 0.075, 0.100, BLACK, 0.001),
        solid(rounded((0.0423, 0.0423), 0.005, (0.150, 0.001)), 0.100, 0.107, STEEL, 0.001),
        *screws(square(0.021, (0.04, 0.001)), 0.067, 0.0695),
    ]


def effector() -> Parts:
    """The rack of 24 x 42 x 191 mm; its frame lies in the tip with z down, so the body is at negative z."""
    return [
        solid(rounded((0.024, 0.042), 0.004), -0.191, -0.030, STEEL, 0.001),
        solid(rounded((0.0235, 0.010), 0.002), -0.1905, -0.0305, BRASS, 0.0005),
        solid(rounded((0.024, 0.042), 0.006), -0.032, -0.022, CHARCOAL, 0.001),
        solid(circle(0.009), -0.022, -0.010, BLACK, 0.001),
        solid(circle(0.005), -0.011, -0.004, ORANGE, 0.001),
        cone(0.0045, -0.005, 0.0, ORANGE),
    ]


def cone(radius: float, low: float, high: float, material: PBRMaterial) -> trimesh.Trimesh:
    """A cone whose point is at `high` [m]."""
    return hull(np.vstack((np.column_stack((circle(radius), np.full(CORNERS, low))), [[0.0, 0.0, high]])), material)


if __name__ == "__main__":
    drawings = {"base_link": base, "brazo_link": upper_arm, "antebrazo_link": forearm, "efector_link": effector}
    write_meshes(Path(__file__).parent, drawings)
