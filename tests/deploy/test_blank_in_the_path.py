"""A project in a folder with a blank and a letter beyond ASCII in its path, as a user's own folder may have."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.stack.several_arms import words
from gemelo.tools.stack.stack import free_ports
from tests.deploy.test_paths_in_words import tracked
from tests.optional import need

ROOT = project_root()
FOLDER = "mi proyecto ñ"
SETUP = 900.0  # [s] on a machine without any cache


def run(folder: Path, *command: str, timeout: float = 120.0, **environ: str) -> str:
    """What a command prints in that folder; it must succeed."""
    done = subprocess.run(
        command, cwd=folder, env={**os.environ, **environ}, text=True, capture_output=True, timeout=timeout, check=False
    )
    assert done.returncode == 0, f"{command}: {done.stdout[-3000:]}{done.stderr[-3000:]}"
    return done.stdout


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / FOLDER
    made.mkdir()
    return made


def copied(folder: Path, *names: str) -> None:
    """These folders and files of the project, without what was built in them."""
    for name in names:
        if (ROOT / name).is_symlink():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).symlink_to((ROOT / name).readlink())
        elif (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("build", "*.so", "__pycache__"))
        else:
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, folder / name)


def test_the_firmware_core_is_built_there(folder):
    copied(folder, "firmware/core", "firmware/platform/host", "firmware/bindings")
    assert "built firmware/build/libgemelo_core.so" in run(folder, "sh", "firmware/bindings/build.sh")
    assert "up to date" in run(folder, "sh", "firmware/bindings/build.sh")
    assert (folder / "firmware/build/libgemelo_core.so").is_file()


def test_the_motion_core_is_compiled_there_by_commands_whose_paths_are_whole(folder):
    """By a compiler that only looks at the sources it is given: the whole build is that of the folder's setup."""
    need("headers")
    copied(folder, "services/planner/native")
    compiler = folder / "looking"
    compiler.write_text(
        "#!/bin/sh\nout=\nfor each; do\n"
        '  [ "$out" != next ] || out=$each\n  [ "$each" != -o ] || out=next\n'
        '  case $each in *.cpp | /*) [ -e "$each" ] || { echo "no file $each" >&2; exit 1; } ;; esac\ndone\n'
        '[ -z "$out" ] || : >"$out"\n'
    )
    compiler.chmod(0o755)
    said = run(folder, "sh", "services/planner/native/build.sh", sys.executable, CXX="./../../../looking")
    assert "built services/planner/native/_motion" in said


def test_a_path_with_a_blank_is_one_arm_where_it_is_quoted_or_the_only_one(folder):
    shutil.copytree(ROOT / "urdf/rm1", folder / "my arm")
    mine = str(folder / "my arm")
    assert words([f"parol6 '{mine}'"], ROOT) == ["parol6", mine]
    assert words([mine], ROOT) == [mine]
    assert words(["rm1  parol6"], ROOT) == ["rm1", "parol6"]


def test_a_twin_can_be_started_from_there(folder):
    """What `make up` runs before a process, with the folder's own arm, and what it says at the end."""
    copied(folder, "deploy", "pyproject.toml", "process-compose.yaml", "urdf/rm1")
    names = ("ROUTER_PORT", "MQTT_PORT", "VIEWER_PORT", "VIEWER_WEB_PORT", "PANEL_PORT")
    ports = {f"GEMELO_{name}": str(port) for name, port in zip(names, free_ports(5), strict=True)}
    own = {
        "GEMELO_ROBOT": str(folder / "urdf/rm1"), "GEMELO_CELL": str(folder / "urdf/rm1/cell.toml"),
        "GEMELO_PATHS_RUN": str(folder / "run"), "GEMELO_PATHS_OUT": str(folder / "out"), **ports,
    }  # fmt: skip
    run(ROOT, sys.executable, "-m", "gemelo.tools.stack.start_check", **own)
    said = run(folder, "deploy/welcome", **own)
    assert "move --named ready" in said
    made = run(ROOT, sys.executable, "-m", "gemelo.tools.stack.several_arms", f"'{folder}/urdf/rm1' parol6", **own)
    assert Path(made.strip()).is_file()
    (folder / "run").mkdir(exist_ok=True)
    (folder / "run/planner.ready").touch()
    run(folder, "deploy/probe", "planner", **own)


@pytest.mark.full
def test_setup_makes_such_a_folder_ready_and_its_tests_pass(folder):
    for path in tracked():
        copied(folder, str(path))
    own = {"VIRTUAL_ENV": "", "PYTHONPATH": ""}
    run(folder, "make", "setup", timeout=SETUP, **own)
    assert "all is well" in run(folder, ".venv/bin/gemelo", "check", "urdf/rm1", timeout=SETUP, **own)
    assert "ready" in run(folder, ".venv/bin/gemelo", "--simulate", "move", "--named", "ready", timeout=SETUP, **own)
    tests = ("tests/arm/test_cell_file.py", "tests/planner/test_hulls.py")
    run(folder, ".venv/bin/python", "-m", "pytest", "-q", "-n", "0", *tests, timeout=SETUP, **own)
