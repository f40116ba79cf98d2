"""The package from outside: what it loads, what its types say, and what is said where no twin runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import gemelo
from gemelo import api

SLOW = {"zenoh", "numpy", "pinocchio", "coal", "ruckig", "rich", "asyncio", "argparse"}
SCRIPT = """
from typing import assert_type

import gemelo
from gemelo import Node, topics


def carry(arm: gemelo.Arm) -> float:
    plan = arm.plan(named="left", speed=0.5)
    assert_type(plan, gemelo.Plan)
    motion = arm.start(plan, detached=True)
    assert_type(motion.progress, float)
    assert_type(arm.joints, dict[str, float])
    assert_type(arm.pose().position, tuple[float, float, float])
    try:
        arm.move(position=(0.25, 0.15, 0.10), allowed_time=2.0, seed=3)
    except gemelo.Refused as refused:
        assert_type(refused.nearest, gemelo.Target)
        arm.move(**refused.nearest)
    arm.line(offset=(0, 0, -0.05), speed=0.03)
    arm.arc(through=(0.2, 0.0, 0.1), to=(0.1, 0.2, 0.1))
    arm.path([(0.2, 0.0, 0.1), "ready", {"joint": 0.1}, arm.pose()], blend=0.01)
    return plan.duration


with gemelo.connect("parol6", deployment="deploy/local.toml") as arm:
    carry(arm)
    arm.scene.add_box("post", size=(0.04, 0.04, 0.16), at=(0.29, 0.27, 0.08))
    arm.jog(twist=(0.0, 0.0, 0.01), duration=1.0)

with Node("monitor") as node:
    node.subscribe(topics.JOINT_STATES, lambda state: assert_type(state.position, tuple[float, ...]))
"""
WRONG = """
import gemelo

arm = gemelo.connect()
arm.move(postion=(0.1, 0.2, 0.3))
arm.move(named=3)
arm.line(offset=(0, 0, 1), speed="fast")
arm.joints["q1"].upper()
"""


def mypy(folder: Path, text: str, root: Path) -> subprocess.CompletedProcess[str]:
    """`mypy --strict` on a script outside of the project, as a user types it: the package is found by .venv alone."""
    file = folder / "script.py"
    file.write_text(text)
    options = ("--strict", "--no-error-summary", "--config-file=", "--cache-dir", str(root / ".mypy_cache" / "user"))
    environment = {name: value for name, value in os.environ.items() if name != "MYPYPATH"}
    return subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(file)], cwd=folder, env=environment, capture_output=True,
        text=True, timeout=180, check=False,
    )  # fmt: skip


def test_a_script_of_a_user_is_type_complete(tmp_path: Path, root: Path) -> None:
    checked = mypy(tmp_path, SCRIPT, root)
    assert (checked.returncode, checked.stdout) == (0, "")


def test_a_script_with_mistakes_is_told_of_each(tmp_path: Path, root: Path) -> None:
    checked = mypy(tmp_path, WRONG, root)
    lines = {int(line.split(":")[1]) for line in checked.stdout.splitlines() if ": error:" in line}
    assert lines == {5, 6, 7, 8}


def test_the_types_are_shipped(root: Path) -> None:
    text = (root / "pyproject.toml").read_text()
    assert (root / "gemelo/py.typed").is_file()
    assert 'gemelo = ["py.typed"]' in text


def test_every_public_name_is_there() -> None:
    assert all(hasattr(gemelo, name) for name in gemelo.__all__)
    assert gemelo.__all__ == sorted(gemelo.__all__)


def loaded_by(code: str, root: Path) -> set[str]:
    """The modules that a script has loaded at its end."""
    code = f"import gemelo, json, sys\n{code}\nprint(json.dumps(sorted(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    return set(json.loads(done.stdout))


def test_using_every_public_name_loads_no_slow_library(root: Path) -> None:
    assert not SLOW & loaded_by("for name in gemelo.__all__: getattr(gemelo, name)", root)


def test_a_name_loads_its_own_part_alone(root: Path) -> None:
    loaded = loaded_by("assert gemelo.mm(250) == 0.25", root)
    assert "gemelo.api.units" in loaded
    assert not {"gemelo.api.arm", "gemelo.libraries.runtime.node"} & loaded


def test_connecting_loads_no_part_of_the_arm_before_it_is_used(root: Path) -> None:
    """A script that only reads the arm's state waits for no motion, scene, device, seeing, picking or program."""
    loaded = loaded_by("gemelo.connect, gemelo.Arm", root)
    assert "gemelo.api.parts" in loaded
    used_later = {"device", "gripping", "homing", "motion", "picking", "planning", "scene", "seeing", "verification"}
    assert not ({f"gemelo.api.{name}" for name in used_later} | {"gemelo.programs", "zenoh", "ssl"}) & loaded


def test_a_part_is_loaded_when_it_is_used(root: Path) -> None:
    loaded = loaded_by("from gemelo import api; api.motion.Motion", root)
    assert {"gemelo.api.motion", "gemelo.api.planning"} < loaded
    assert "gemelo.api.seeing" not in loaded
    with pytest.raises(AttributeError, match=r"module 'gemelo\.api' has no attribute 'moton'"):
        api.moton  # type: ignore[attr-defined]  # noqa: B018


def test_a_name_that_there_is_not_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'gemelo' has no attribute 'conect'"):
        gemelo.conect  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize(
    ("environ", "said"),
    [
        ({"GEMELO_ROUTER_PORT": "1"}, "Lost: no router at 127.0.0.1:1: start the twin with `make up`"),
        (
            {"GEMELO_ROUTER_HOST": "192.0.2.1", "GEMELO_ROUTER_PORT": "1"},
            "192.0.2.1:1: is that host on, does it answer",
        ),
        ({"GEMELO_ROBOT": "urdf/nobody"}, "Error: "),
        ({"GEMELO_CONFIG": "nothing.toml"}, "nothing.toml: there is no such file"),
    ],
)
def test_without_a_twin_it_is_said_at_once_what_is_missing(root: Path, environ: dict[str, str], said: str) -> None:
    code = textwrap.dedent("""
        import gemelo
        try:
            gemelo.connect()
        except gemelo.Error as error:
            print(f"{type(error).__name__}: {error}")
    """)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=root, env={**os.environ, **environ}, capture_output=True, text=True,
        timeout=30, check=True,
    )  # fmt: skip
    assert said in done.stdout
    assert done.stderr == ""
