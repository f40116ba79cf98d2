"""The trial at the end of `gemelo check`: plans succeed, or what keeps them from it is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.checks.findings import Severity
from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.trial import looking_the_same, trial
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.arm.editing import edit
from tests.arm.plates import add_rigid_plates, add_turning_disc

RM1 = Path(__file__).parents[2] / "urdf" / "rm1"
LONG = 60.0  # [s]: every configuration and plan is tried however loaded the machine is


@pytest.fixture
def copy(rm1_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(rm1_folder, tmp_path / "rm1"))


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_plans_of_the_shipped_robots_succeed(rm1_folder: Path, robot: str):
    assert trial(load_arm(rm1_folder.parent / robot), LONG) == []


def test_a_pair_that_is_always_near_is_named_with_how_near_it_is(copy: Path):
    add_turning_disc(copy, gap=0.0016)
    findings = trial(load_arm(copy), LONG)
    pairs = [finding for finding in findings if finding.subject.startswith("pair")]
    assert [finding.severity for finding in pairs] == [Severity.ERROR]
    assert set(pairs[0].of.name.split(" / ")) == {"rest_plate", "disc"}
    why = pairs[0].what
    assert (why.code, why.values["times"], why.values["count"]) == ("trial.pair.near", 300, 300)
    assert [why.values[each] for each in ("nearest", "farthest")] == pytest.approx([0.0016, 0.0016], abs=1e-5)
    assert [each.code for each in why.remedies] == ["excuse_pairs", "correct_shapes"]


def test_a_state_that_does_not_keep_the_clearance_is_named(copy: Path):
    add_turning_disc(copy, gap=0.0016)
    named = [finding.what for finding in trial(load_arm(copy), LONG) if finding.subject == 'state "home"']
    assert [why.code for why in named] == ["trial.state.near"]
    values = named[0].values
    assert {values["first"], values["second"]} == {"disc", "rest_plate"}
    assert values["distance"] == pytest.approx(0.0016, abs=1e-5)
    assert values["clearance"] == 0.004


def test_a_written_matrix_leaves_a_working_robot(copy: Path, capsys: pytest.CaptureFixture[str]):
    add_rigid_plates(copy, gap=0.0016)
    add_turning_disc(copy, gap=0.0041 - 0.0002)
    assert run(["collision", "matrix", str(copy), "--write"]) is ExitCode.OK
    assert trial(load_arm(copy), LONG) == []


def test_check_says_all_is_well_only_where_plans_succeed(copy: Path, capsys: pytest.CaptureFixture[str]):
    assert run(["check", str(copy)]) is ExitCode.OK
    assert "all is well" in capsys.readouterr().out
    edit(copy / "robot.toml", 'tool_frame = "efector_link"', 'tool_frame = "efector_link"\nclearance = 0.002')
    add_turning_disc(copy, gap=0.0016)
    assert run(["check", str(copy)]) is ExitCode.FAILED
    said = capsys.readouterr().out
    assert "all is well" not in said
    assert "nearer than the clearance of 2 mm" in said


@given(st.data())
def test_a_goal_is_turned_to_what_looks_the_same_within_the_limits(data: st.DataObject):
    arm = load_arm(RM1)
    lower, upper = (np.array([getattr(joint, side) for joint in arm.joints]) for side in ("lower", "upper"))
    start, goal = (np.array([data.draw(st.floats(*each)) for each in zip(lower, upper, strict=True)]) for _ in range(2))
    turned = list(looking_the_same(arm, start, goal))
    assert len({tuple(np.round(each, 9)) for each in turned}) == len(turned)
    for each in turned:
        turns = (each - goal) / (2 * np.pi)
        assert turns == pytest.approx(np.round(turns), abs=1e-9)
        assert (each >= lower).all()
        assert (each <= upper).all()
    assert (abs(turned[0] - start) <= np.maximum(np.pi, abs(goal - start)) + 1e-9).all()
