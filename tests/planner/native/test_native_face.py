"""The Python face: what the stub promises is there, and what is missing says so."""

from __future__ import annotations

import ast
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gemelo.services.planner.collision_geometry.shapes import CollisionShape, ShapeKind
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.native_planner import NativePlanner
from tests.planner.native.conftest import load

STUB = Path(motion.__file__).with_name("_motion.pyi")
WITHOUT = """
import sys
sys.modules["gemelo.services.planner.native._motion"] = None
try:
    import gemelo.services.planner.native.binding
except ImportError as error:
    print(type(error).__name__, error)
"""

CHOSEN = """
import sys
sys.modules["gemelo.services.planner.native.binding"] = None
from gemelo.services.planner.collision.sphere_check import cancel_flag, counted_time, native_planner
from gemelo.services.planner.timing.profile import stop_and_go
from gemelo.services.planner.timing.timing import timed_path
from gemelo.services.planner.verification.feasibility import peak_rates
from gemelo.services.planner.verification.verify import evaluated
print(type(cancel_flag()).__name__, type(counted_time(0.5)).__name__, native_planner(None))
print(stop_and_go.__name__, timed_path.__name__, peak_rates.__name__, evaluated.__name__)
"""
PLANNER = Path(motion.__file__).parents[1]


def test_the_module_has_all_that_its_stub_promises_and_nothing_else():
    promised = {
        node.name for node in ast.parse(STUB.read_text()).body if isinstance(node, ast.FunctionDef | ast.ClassDef)
    }
    assert {name for name in dir(motion) if not name.startswith("_")} == promised


def test_without_the_compiled_module_the_remedy_is_said():
    said = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, timeout=60, check=True)
    assert said.stdout.startswith("NativeMissing the native planner cannot be loaded")
    assert "make setup" in said.stdout
    assert "sudo apt-get install python3-dev" in said.stdout


def test_without_the_compiled_module_python_takes_its_place_everywhere():
    said = subprocess.run([sys.executable, "-c", CHOSEN], capture_output=True, text=True, timeout=60, check=True)
    kinds, functions = said.stdout.splitlines()
    assert kinds.split() == ["Event", "CountedInPython", "None"]
    assert all(name.endswith("_in_python") for name in functions.split())


def test_one_module_alone_chooses_between_the_compiled_core_and_python():
    asking = [path.name for path in PLANNER.rglob("*.py") if "native.binding" in path.read_text()]
    choosing = [path.name for path in PLANNER.rglob("*.py") if "IN_PYTHON" in path.read_text()]
    assert choosing == ["compiled.py"]
    assert set(asking) <= {path.name for path in (PLANNER / "native").glob("*.py")}


def test_one_configuration_alone_is_judged_as_among_others(arm, core, configurations):
    core.set_scene([CollisionShape("box", ShapeKind.BOX, (0.3, 0.2, 0.4), ((0.3, 0.1, 0.2), (0.0, 0.0, 0.0, 1.0)))])
    rows = configurations(300, 4)
    free = core.free(rows)
    assert [core.is_free(row.tolist()) for row in rows] == free.tolist()
    assert core.is_free(rows[0]) == free[0]
    assert 0 < free.sum() < len(rows)
    with pytest.raises(ValueError, match=f"{len(arm.joints)} columns"):
        core.is_free(rows[0, 1:])
    with pytest.raises(ValueError, match="wrap it into one turn"):
        core.is_free([101.0, *rows[0, 1:]])


def test_an_obstacle_along_the_axes_is_judged_as_one_that_is_hardly_turned(arm, core, configurations):
    rows = configurations(2000, 5)
    verdicts = []
    for turn in (0.0, 1e-7):
        turned = (math.sin(turn), 0.0, math.sin(turn), math.cos(turn))
        shapes = [
            CollisionShape(f"{kind}", kind, size, ((x, 0.2, 0.3), turned))
            for kind, size, x in (
                (ShapeKind.BOX, (0.2, 0.1, 0.3), 0.3), (ShapeKind.CYLINDER, (0.1, 0.4), -0.3),
                (ShapeKind.SPHERE, (0.12,), 0.0), (ShapeKind.CAPSULE, (0.05, 0.3), 0.5),
            )
        ]  # fmt: skip
        core.set_scene(shapes)
        verdicts.append(core.free(rows))
    assert (verdicts[0] != verdicts[1]).mean() < 0.002  # those that stand within a hair of the margin
    assert 0 < verdicts[0].sum() < len(rows)


def test_two_hundred_obstacles_are_no_more_than_the_same_asked_one_by_one():
    core = NativePlanner(load("parol6"))
    rng = np.random.default_rng(2)
    angles, radii, heights = rng.uniform([0.0, 0.25, 0.0], [6.28, 0.6, 0.6], (200, 3)).T
    places = np.column_stack((radii * np.cos(angles), radii * np.sin(angles), heights)).tolist()
    upright = (0.0, 0.0, 0.0, 1.0)
    size = (0.02, 0.01, 0.03)
    shapes = [CollisionShape(f"{i}", ShapeKind.BOX, size, ((x, y, z), upright)) for i, (x, y, z) in enumerate(places)]
    rows = rng.uniform([-2, -2.4, 1.9, -1.8, -1.5, 0], [2, -0.1, 5.0, 1.8, 1.5, 6], (500, 6))
    core.set_scene(shapes)
    together = core.free(rows)
    one_by_one = np.ones(len(rows), dtype=bool)
    for shape in shapes:
        core.set_scene([shape])
        one_by_one &= core.free(rows)
    assert np.array_equal(together, one_by_one)
    assert 0 < together.sum() < len(rows)
