"""A user's own modules are never in the way of gemelo's."""

from __future__ import annotations

from pathlib import Path

from tests.gemelo.own_names import run_among_own_names

SCRIPT = """
import gemelo

with gemelo.simulate("rm1") as arm:
    arm.move(named="ready")
    print(round(arm.joints["brazo_joint"], 2), arm.states["ready"]["brazo_joint"])
"""


def test_a_script_beside_modules_of_the_names_of_our_rooms_moves_an_arm(tmp_path: Path) -> None:
    done = run_among_own_names(tmp_path, SCRIPT)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "0.6 0.6\n"
