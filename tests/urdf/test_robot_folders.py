"""Properties of every robot's folder that comes with the project."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

URDF = Path(__file__).parents[2] / "urdf"
ROBOTS = sorted(file.parent.name for file in URDF.glob("*/robot.toml"))


def test_both_arms_are_looked_at():
    assert {"rm1", "parol6"} <= set(ROBOTS)


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_meshes_are_small(robot: str):
    for mesh in (URDF / robot / "meshes").iterdir():
        assert mesh.stat().st_size < 150_000


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_meshes_are_what_their_script_draws(robot: str, tmp_path: Path):
    command = [sys.executable, "-m", f"urdf.{robot}.make_meshes", str(tmp_path)]
    subprocess.run(command, cwd=URDF.parent, check=True, capture_output=True)
    meshes = URDF / robot / "meshes"
    names = sorted(path.name for path in meshes.iterdir())
    assert names == sorted(path.name for path in tmp_path.iterdir())
    for name in names:
        assert (tmp_path / name).stat().st_size == (meshes / name).stat().st_size


@pytest.mark.parametrize("robot", ROBOTS)
def test_nothing_refers_to_a_ros_package(robot: str):
    assert not re.search(r"package://|file://", (URDF / robot / "robot.urdf").read_text())
