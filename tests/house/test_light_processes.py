"""Libraries that a process does not load until it needs them: each is tens of megabytes on a small computer."""

from __future__ import annotations

import subprocess
import sys

import pytest

DRAWING = ("trimesh", "yourdfpy", "scipy", "networkx", "lxml")  # the arm, once a browser is there


@pytest.mark.parametrize(
    ("process", "later"),
    [
        ("panel.main", DRAWING),
        ("visualizer.viewer", ("rerun", "numpy", "pyarrow", "zenoh")),
        ("stepper_gateway.main", ("numpy", "scipy", "paho", "serial")),
        ("state_publisher.main", ("numpy", "scipy")),
        ("router.main", ("numpy",)),
        ("camera.main", ("numpy", "cv2")),
        ("detector.main", ("numpy", "cv2")),
        ("logger.main", ("numpy", "scipy", "rerun", "trimesh")),
        ("planner.main", ("scipy", "trimesh", "rerun", "ompl", "toppra")),
    ],
)
def test_what_a_process_loads_at_its_start(process: str, later: tuple[str, ...]) -> None:
    program = f"import sys, gemelo.services.{process}\nprint(*(set({later!r}) & set(sys.modules)))"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120.0)
    assert (ran.stderr, ran.stdout.split()) == ("", [])
