"""rm1 with a board that speaks another dialect, as a folder of its own."""

from __future__ import annotations

import shutil
from pathlib import Path

from tests.stepper_gateway.harness import ROOT


def robot_with(folder: Path, *lines: str) -> Path:
    """A copy of urdf/rm1 in `folder` with these lines in its [device]."""
    robot = folder / "rm1"
    shutil.copytree(ROOT / "urdf/rm1", robot)
    path = robot / "robot.toml"
    added = "[device]\n" + "".join(f"{line}\n" for line in lines)
    text = path.read_text(encoding="utf-8").replace("[device]\n", added, 1)
    path.write_text(text, encoding="utf-8")
    return robot
