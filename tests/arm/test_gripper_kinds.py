"""A kind of gripper that the board drives by a command that it has: one file, and one row of the table of kinds."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.additions import ROOT, added, row_added, run_in
from tests.arm.editing import edit

RACK = '''"""A gripper of two racks on the pinion of a hobby servo."""

from __future__ import annotations

from gemelo.schemas.grippers.gripper import GripperRecord, PulseDrive
from gemelo.schemas.robot_record import Pin, Positive, PulseWidth

US_PER_RADIAN = 2000.0 / 3.1416  # [us/rad] of usual servos


class RackGripper(GripperRecord, frozen=True, kw_only=True, tag_field="kind", tag="rack"):
    """Its pulses follow from the radius of the pinion."""

    pin: Pin
    pinion_radius: Positive  # [m]
    closed_us: PulseWidth
    speed: Positive  # [m/s] of the opening

    @property
    def drive(self) -> PulseDrive:
        turn = (self.open - self.closed) / (2.0 * self.pinion_radius)  # [rad]
        return PulseDrive(
            pin=self.pin, open=self.open, closed=self.closed, open_us=round(self.closed_us + turn * US_PER_RADIAN),
            closed_us=self.closed_us, speed=self.speed,
        )

    def fault(self) -> tuple[str, str]:
        if self.drive.open_us <= 2500:
            return "", ""
        return "pinion_radius", f"{self.pinion_radius:g} m opens at {self.drive.open_us} us: choose a larger pinion"
'''
GRIPPER = """[gripper]
kind = "rack"
pin = 14
open = 0.05
effort = 11.0
jaw = [0.012, 0.006, 0.016]
pinion_radius = 0.016
closed_us = 1000
speed = 0.1
"""
SCRIPT = """
import json, sys
import gemelo

with gemelo.simulate(sys.argv[1]) as arm:
    to = [arm.grip(where).position for where in ("open", 0.025, "close")]
    print(json.dumps([to, type(arm.description.gripper).__name__, arm.gripper.known]))
"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """This one, with the kind `rack`."""
    kinds = "schemas/grippers/kinds.py"
    row = row_added(kinds, after="    | ServoGripper", row="    | RackGripper")[kinds]
    imported = "from gemelo.schemas.grippers.rack import RackGripper\n"
    row = row.replace("from gemelo.schemas.grippers.servo", f"{imported}from gemelo.schemas.grippers.servo")
    return added(tmp_path_factory.mktemp("project"), {"schemas/grippers/rack.py": RACK, kinds: row})


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """rm1 with two racks on a pinion."""
    folder = tmp_path / "rm1"
    shutil.copytree(ROOT / "urdf/rm1", folder)
    text = (folder / "robot.toml").read_text()
    begin = text.index("[gripper]\n")
    end = text.find("\n\n", begin)
    (folder / "robot.toml").write_text(text[:begin] + GRIPPER + (text[end:] if end > 0 else ""))
    return folder


def test_a_gripper_of_a_new_kind_opens_and_closes(project: Path, robot: Path, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    done = run_in(project, str(tmp_path / "script.py"), str(robot))
    assert (done.returncode, done.stderr) == (0, "")
    to, kind, known = json.loads(done.stdout)
    assert to == pytest.approx([0.05, 0.025, 0.0], abs=1e-4)
    assert (kind, known) == ("RackGripper", True)


def test_what_is_wrong_with_it_is_named_with_its_line(project: Path, robot: Path) -> None:
    edit(robot / "robot.toml", "pinion_radius = 0.016", "pinion_radius = 0.008")
    done = run_in(project, "-m", "gemelo.tools.cli.main", "check", str(robot))
    line = (robot / "robot.toml").read_text().splitlines().index("pinion_radius = 0.008") + 1
    assert f"line {line}: [gripper] pinion_radius 0.008 m opens at 2989 us: choose a larger pinion" in done.stdout
    edit(robot / "robot.toml", "pinion_radius = 0.008", "pinion_radios = 0.016")
    done = run_in(project, "-m", "gemelo.tools.cli.main", "check", str(robot))
    assert f'line {line}: unknown key `gripper.pinion_radios` -> did you mean "pinion_radius"' in done.stdout
