"""Figures of a client: an environment with nothing but the wheel and what it needs, and how long it takes to import."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from gemelo.libraries.runtime.deployment import project_root
from gemelo.tools.bench.extra_sizes import run_tool, size_mb, uv_of
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples

ENVIRONMENT = FigureGoal(median=45.0)  # [MB] without bytecode
IMPORTED = FigureGoal(median=30.0)  # [ms]
TIMES = 21  # chosen: of each program
WHEEL = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"
TIMED = "import time; began = time.perf_counter(); import {what}; print(1e3 * (time.perf_counter() - began))"


def client_env_mb() -> Figure:
    """What a client's environment takes [MB]: eclipse-zenoh, msgspec and the wheel; the reference is without that."""
    with tempfile.TemporaryDirectory() as temporary:
        bare = install(Path(temporary) / "bare", ())
        client = install(Path(temporary) / "client", (wheel(Path(temporary)),))
        return of_samples([size_mb(client)], ENVIRONMENT, {"without gemelo": round(size_mb(bare), 1)})


def client_import_ms() -> Figure:
    """How long `import gemelo` takes in such an environment [ms]; the reference is zenoh's own."""
    with tempfile.TemporaryDirectory() as temporary:
        client = install(Path(temporary) / "client", (wheel(Path(temporary)),))
        samples = {what: [imported_ms(client, what) for _ in range(TIMES)] for what in ("gemelo", "zenoh")}
    zenoh = sorted(samples["zenoh"])[TIMES // 2]
    return of_samples(samples["gemelo"], IMPORTED, {"import zenoh": round(zenoh, 2)})


def wheel(folder: Path) -> str:
    """The path of a wheel of the last commit, built in `folder`."""
    source = folder / "source"
    run_tool("git", "clone", "--quiet", str(project_root()), str(source))
    done = subprocess.run(
        [sys.executable, "-c", WHEEL, str(folder)], cwd=source, capture_output=True, text=True, check=True
    )
    return str(folder / done.stdout.splitlines()[-1])


def install(folder: Path, wheels: tuple[str, ...]) -> Path:
    """An environment with these and the base dependencies, in the lock's versions."""
    uv = uv_of(project_root())
    run_tool(uv, "venv", "--quiet", "--python", sys.executable, str(folder))
    run_tool(
        uv, "pip", "install", "--quiet", "--python", str(folder / "bin/python"), "--requirement", "pyproject.toml",
        *wheels, "--constraints", "requirements.lock",
    )  # fmt: skip
    return folder


def imported_ms(environment: Path, what: str) -> float:
    """[ms] that one process takes to import the module, as it counts itself."""
    command = [str(environment / "bin/python"), "-c", TIMED.format(what=what)]
    return float(subprocess.run(command, cwd=environment, capture_output=True, text=True, check=True).stdout)
