"""Draw parol6: one small GLB a link. From the project's folder: `python -m urdf.parol6.make_meshes`.

Our own shapes, within the published sizes of the links; nothing is taken from the arm's published meshes.
"""

from __future__ import annotations

from pathlib import Path

from trimesh.visual.material import PBRMaterial

from urdf.drawing import (
    BLACK,
    CHARCOAL,
    STEEL,
    WHITE,
    Outline,
    Parts,
    circle,
    rounded,
    solid,
    tapered,
    write_meshes,
)

TEAL = PBRMaterial(name="teal", baseColorFactor=[0.06, 0.52, 0.53, 1.0], metallicFactor=0.1, roughnessFactor=0.45)


def beam(radius: float, start: tuple[float, float], end: tuple[float, float]) -> Outline:
    """A strip between two round ends."""
    return tapered(radius, start, radius, end)


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


if __name__ == "__main__":
    links = (base, turret, upper_arm, elbow, forearm, wrist, hand)
    names = ("base_link", *(f"link_{number}" for number in range(1, 7)))
    write_meshes(Path(__file__).parent, dict(zip(names, links, strict=True)))
