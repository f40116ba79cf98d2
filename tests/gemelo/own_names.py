"""A folder of a user's own whose modules are called as rooms of gemelo, and as a module of a library, are."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

OWN = (
    "schemas.py",
    "services/__init__.py",
    "libraries.py",
    "firmware.py",
    "tools.py",
    "tests.py",
    "typing_extensions.py",
)


def run_among_own_names(folder: Path, script: str, **environ: str) -> subprocess.CompletedProcess[str]:
    """`python script.py` in that folder, whose modules have nothing in them."""
    for name in OWN:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text('"""The user\'s own."""\n')
    (folder / "pyproject.toml").write_text('[project]\nname = "web"\n')
    (folder / "script.py").write_text(script)
    return subprocess.run(
        [sys.executable, "script.py"], cwd=folder, env={**os.environ, **environ}, capture_output=True, text=True,
        timeout=120, check=False,
    )  # fmt: skip
