"""Writes a CAD export to practise on, out/my_arm_description: a ROS package with the faults that such exports have.

Three joints, meshes in millimetres, package:// paths, no velocity, no effort, an axis that is not of unit length.
"""

from __future__ import annotations

import math
import struct
import sys
from itertools import pairwise
from pathlib import Path

SIDES = 24
LINKS = {"base_link": (60.0, 80.0), "upper arm": (35.0, 200.0), "forearm": (28.0, 180.0), "hand": (20.0, 60.0)}  # [mm]
GAP = 25.0  # [mm] between two links
JOINTS = (("waist", "0 0 2"), ("shoulder", "0 1 0"), ("elbow", "0 1 0"))
LIMIT = '<limit lower="-2.4" upper="2.4" effort="0" velocity="0"/>'

Corner = tuple[float, float, float]


def tube(radius: float, length: float) -> bytes:
    """A binary STL of a closed tube along z, of `radius` and `length` [mm]."""
    ring = [(radius * math.cos(math.tau * k / SIDES), radius * math.sin(math.tau * k / SIDES)) for k in range(SIDES)]
    triangles: list[tuple[Corner, Corner, Corner]] = []
    for (ax, ay), (bx, by) in zip(ring, [*ring[1:], ring[0]], strict=True):
        low_a, low_b, high_a, high_b = (ax, ay, 0.0), (bx, by, 0.0), (ax, ay, length), (bx, by, length)
        triangles += [(low_a, low_b, high_b), (low_a, high_b, high_a)]
        triangles += [((0.0, 0.0, 0.0), low_b, low_a), ((0.0, 0.0, length), high_a, high_b)]
    rows = [struct.pack("<12fH", 0.0, 0.0, 0.0, *a, *b, *c, 0) for a, b, c in triangles]
    return bytes(80) + struct.pack("<I", len(rows)) + b"".join(rows)


def link(name: str) -> str:
    """A link that is drawn and touched by its mesh."""
    shape = f'<geometry><mesh filename="package://my_arm_description/meshes/{name}.STL"/></geometry>'
    return f'  <link name="{name}">\n    <visual>{shape}</visual>\n    <collision>{shape}</collision>\n  </link>'


def joint(name: str, axis: str, parent: str, child: str) -> str:
    """A joint above its parent."""
    height = (LINKS[parent][1] + GAP) / 1000.0
    return (
        f'  <joint name="{name}" type="revolute">\n    <parent link="{parent}"/><child link="{child}"/>\n'
        f'    <origin xyz="0 0 {height}" rpy="0 0 0"/>\n    <axis xyz="{axis}"/>\n    {LIMIT}\n  </joint>'
    )


def write(folder: Path) -> None:
    """The whole package."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    (folder / "urdf").mkdir(exist_ok=True)
    (folder / "package.xml").write_text('<package format="2"><name>my_arm_description</name></package>\n')
    for name, (radius, length) in LINKS.items():
        (folder / "meshes" / f"{name}.STL").write_bytes(tube(radius, length))
    names = list(LINKS)
    joints = [joint(*each, *pair) for each, pair in zip(JOINTS, pairwise(names), strict=True)]
    text = "\n".join(['<?xml version="1.0"?>', '<robot name="my_arm">', *map(link, names), *joints, "</robot>", ""])
    (folder / "urdf" / "my_arm.urdf").write_text(text)


if __name__ == "__main__":
    write(Path(sys.argv[1] if len(sys.argv) > 1 else "out/my_arm_description"))
