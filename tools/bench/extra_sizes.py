"""The figure of what a host installs: base and extras, each in an environment of its own, in the lock's versions."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples

STACK = ("stack",)  # of every host that runs a service
EXTRAS = ("record", "planner", "view", "panel", "eyes")
GOAL = FigureGoal(median=150.0)  # [MB] of a host with nothing but a gateway
INSTALLED_WITHIN = 600.0  # [s] of one environment


def extra_mb() -> Figure:
    """What an environment of a gateway's host takes [MB], its bytecode too; with each extra as the references."""
    uv = uv_of(project_root())
    with tempfile.TemporaryDirectory() as temporary:
        base = installed_mb(uv, Path(temporary) / "base", STACK)
        sizes = {extra: installed_mb(uv, Path(temporary) / extra, (*STACK, extra)) for extra in EXTRAS}
    note = "the base runs router, stepper_gateway, state_publisher, virtual_esp32 and gemelo; references: with an extra"
    return of_samples([base], GOAL, {f"with {extra}": round(size, 1) for extra, size in sizes.items()}, note)


def installed_mb(uv: str, folder: Path, extras: Sequence[str]) -> float:
    """[MB] of all files of an environment with the base and `extras`, in the lock's versions, imported once."""
    run_tool(uv, "venv", "--quiet", "--python", sys.executable, str(folder))
    chosen = [word for extra in extras for word in ("--extra", extra)]
    run_tool(
        uv, "pip", "install", "--quiet", "--compile-bytecode", "--python", str(folder / "bin/python"),
        "--requirement", "pyproject.toml", *chosen, "--constraints", "requirements.lock",
    )  # fmt: skip
    return size_mb(folder)


def size_mb(folder: Path) -> float:
    """[MB] of all files below it."""
    return sum(file.lstat().st_size for file in folder.rglob("*") if not file.is_dir()) / 1e6


def run_tool(*command: str) -> None:
    """Raises `NotMeasured` with the last line of what it said, as without a package index."""
    try:
        done = subprocess.run(
            command, cwd=project_root(), capture_output=True, text=True, timeout=INSTALLED_WITHIN, check=False,
            env={**os.environ, "UV_LINK_MODE": "hardlink"},
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise NotMeasured(f"{' '.join(command[:3])} took more than {INSTALLED_WITHIN:g} s") from error
    if done.returncode:
        lines = done.stderr.strip().splitlines() or ["no word"]
        raise NotMeasured(f"{' '.join(command[:3])}: {lines[-1].strip()}")


def uv_of(root: Path) -> str:
    """The program; raises `NotMeasured` where there is none."""
    found = shutil.which("uv") or str(root / ".gemelo/tools/uv/bin/uv")
    if not Path(found).exists():
        raise NotMeasured("there is no uv: make setup brings one where PATH has none")
    return found
