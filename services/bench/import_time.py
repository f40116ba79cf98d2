"""The figure of `gemelo import`: from a CAD export of six joints with meshes to the finished robot."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import trimesh

from services.bench.figures import Figure, Goal, of_samples

RUNS = 3
JOINTS = 6
LENGTH, GAP = 180.0, 30.0  # [mm] of a link, and between two
LIMIT = '<limit lower="-2.6" upper="2.6" effort="20" velocity="2"/>'


def import_s() -> Figure:
    """Time [s] of one import whose questions are answered by defaults; the reference is a check of what it wrote."""
    samples: list[float] = []
    with tempfile.TemporaryDirectory() as temporary:
        source = export(Path(temporary) / "six_description")
        for run in range(RUNS):
            output = Path(temporary) / f"run_{run}"
            samples.append(_seconds("import", str(source), "--yes", "--output", str(output)))
        check = _seconds("check", str(output / "six"))
    triangles = len(part(0).faces)
    note = f"{JOINTS} joints, {JOINTS + 1} links of {triangles} triangles each; {RUNS} runs"
    return of_samples(samples, Goal(median=20.0), {"gemelo check of it": check}, note)


def part(index: int) -> trimesh.Trimesh:
    """A link [mm] along z as CAD programs give it: a tube, a motor across it, a plate and a ball, in one file."""
    radius = 40.0 - 3.0 * index
    tube = trimesh.creation.cylinder(radius=radius, height=LENGTH, sections=64)
    motor = trimesh.creation.cylinder(radius=0.7 * radius, height=2.6 * radius, sections=64)
    motor.apply_transform(trimesh.transformations.rotation_matrix(1.5708, (1.0, 0.0, 0.0)))
    plate = trimesh.creation.box((2.4 * radius, 1.2 * radius, 8.0)).subdivide().subdivide()
    plate.apply_translation((0.0, 0.0, LENGTH / 2 - 4.0))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.8 * radius)
    ball.apply_translation((0.0, 0.0, -LENGTH / 4))
    whole = trimesh.util.concatenate([tube, motor, plate, ball])
    whole.apply_translation((0.0, 0.0, LENGTH / 2))
    assert isinstance(whole, trimesh.Trimesh)
    return whole


def export(folder: Path, link: Callable[[int], trimesh.Trimesh] = part) -> Path:
    """A ROS package with meshes [mm], which `link` gives for each number, and package:// paths."""
    (folder / "meshes").mkdir(parents=True)
    (folder / "urdf").mkdir()
    (folder / "package.xml").write_text(f'<package format="2"><name>{folder.name}</name></package>\n')
    names = [f"link_{index}" for index in range(JOINTS + 1)]
    for index, name in enumerate(names):
        link(index).export(folder / "meshes" / f"{name}.stl")
    lines = ['<?xml version="1.0"?>', '<robot name="six">', *(_link(folder.name, name) for name in names)]
    for index, (parent, child) in enumerate(pairwise(names)):
        axis = "0 0 1" if index in (0, 3, 5) else "0 1 0"
        lines.append(
            f'<joint name="joint_{index + 1}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="0 0 {(LENGTH + GAP) / 1000.0}"/><axis xyz="{axis}"/>{LIMIT}</joint>'
        )
    (folder / "urdf" / "six.urdf").write_text("\n".join([*lines, "</robot>"]))
    return folder


def _link(package: str, name: str) -> str:
    shape = f'<geometry><mesh filename="package://{package}/meshes/{name}.stl" scale="0.001 0.001 0.001"/></geometry>'
    return f'<link name="{name}"><visual>{shape}</visual><collision>{shape}</collision></link>'


def _seconds(*words: str) -> float:
    began = time.monotonic()
    subprocess.run([sys.executable, "-m", "services.cli.main", *words], check=True, stdout=subprocess.DEVNULL)
    return time.monotonic() - began
