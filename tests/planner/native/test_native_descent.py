"""The compiled descents against those in Python, on arms of every kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.services.planner.kinematics.centring import Centring
from gemelo.services.planner.kinematics.descent import Descent, tool_position, tool_position_in_python
from gemelo.services.planner.kinematics.targets import ToolTarget

ARMS = Path(__file__).parents[1] / "arms"
FOLDERS = [project_root() / "urdf/rm1", project_root() / "urdf/parol6", *sorted(ARMS.iterdir())]
STARTS = 12


class Both:
    """One arm's descents, compiled and not, and random configurations within its limits."""

    def __init__(self, arm: ArmDescription) -> None:
        self.kinematics = Kinematics(arm)
        self.compiled, self.plain = Descent(arm, self.kinematics), Descent(arm, self.kinematics, is_plain=True)
        assert self.compiled.knows_centring(ToolTarget(self.kinematics.tool(np.zeros(len(arm.joints))).position))
        spans = np.array([(max(joint.lower, -3.0), min(joint.upper, 3.0)) for joint in arm.joints]).T
        self.rows = np.random.default_rng(1).uniform(*spans, (2 * STARTS, len(arm.joints)))

    def pairs(self):
        return zip(self.rows[:STARTS], self.rows[STARTS:], strict=True)


@pytest.fixture(params=FOLDERS, ids=lambda folder: folder.name)
def both(request: pytest.FixtureRequest) -> Both:
    return Both(load_arm(request.param))


def test_the_tool_is_where_pinocchio_has_it(both: Both):
    arm = both.kinematics.arm
    compiled, plain = tool_position(arm, both.kinematics), tool_position_in_python(arm, both.kinematics)
    for row in both.rows:
        expected = pytest.approx(both.kinematics.tool(row).position, abs=1e-12)
        assert compiled(row) == expected
        assert compiled(tuple(row.tolist())) == compiled(row)
        assert plain(row) == expected


@pytest.mark.parametrize("with_turn", [False, True])
def test_they_end_where_those_in_python_end(both: Both, with_turn: bool):
    for wanted, start in both.pairs():
        pose = both.kinematics.tool(wanted)
        target = ToolTarget(pose.position, pose.rotation if with_turn else None)
        one, other = both.compiled.descend(target, start), both.plain.descend(target, start)
        assert one.is_solution == other.is_solution
        assert one.error == pytest.approx(other.error, abs=1e-6, rel=1e-2)


@pytest.mark.parametrize("with_turn", [False, True])
def test_what_they_call_a_solution_meets_the_target(both: Both, with_turn: bool):
    for wanted, start in both.pairs():
        pose = both.kinematics.tool(wanted)
        target = ToolTarget(pose.position, pose.rotation if with_turn else None)
        for near in (start, wanted + 0.01):
            attempt = both.compiled.descend(target, near)
            error, _ = target.error_and_jacobian(both.kinematics, attempt.positions)
            assert attempt.error == pytest.approx(float(np.linalg.norm(error)), abs=1e-9)
            assert attempt.is_solution == target.is_exact(error)
            assert (both.compiled.clip(attempt.positions) == attempt.positions).all()


@pytest.mark.parametrize("tolerance", [0.0, 0.01])
def test_several_at_once_end_where_each_alone_does(both: Both, tolerance: float):
    pose = both.kinematics.tool(both.rows[0])
    target = ToolTarget(pose.position, pose.rotation, position_tolerance=tolerance)
    for one, start in zip(both.compiled.descend_all(target, both.rows), both.rows, strict=True):
        alone = both.compiled.descend(target, start)
        assert np.array_equal(one.positions, alone.positions)
        assert (one.error, one.is_solution) == (alone.error, alone.is_solution)
    assert both.compiled.descend_all(target, both.rows[:0]) == []


@pytest.mark.parametrize("angle", [1e-9, 1e-4, 1.0, 3.0, np.pi - 1e-4])
def test_turns_of_every_size_are_taken_as_pinocchio_does(angle: float):
    both = Both(load_arm(project_root() / "urdf/parol6"))
    axes = np.random.default_rng(2).normal(size=(len(both.rows), 3))
    for start, axis in zip(both.rows, axes, strict=True):
        pose = both.kinematics.tool(start)
        turn = pin.exp3(angle * axis / np.linalg.norm(axis))
        target = ToolTarget(pose.position, turn @ pose.rotation)
        one, other = both.compiled.descend(target, start), both.plain.descend(target, start)
        assert one.is_solution == other.is_solution
        assert one.error == pytest.approx(other.error, abs=1e-6, rel=1e-2)


@pytest.mark.parametrize("with_turn", [False, True])
def test_compiled_self_motion_goes_as_far_to_the_middles_as_that_in_python_and_keeps_the_tool(
    both: Both, with_turn: bool
):
    arm = both.kinematics.arm
    compiled = Centring(arm, both.kinematics, both.compiled)
    plain = Centring(arm, both.kinematics, both.plain)
    for wanted, _ in both.pairs():
        pose = both.kinematics.tool(wanted)
        target = ToolTarget(pose.position, pose.rotation if with_turn else None)
        one, other = compiled.centred(target, wanted), plain.centred(target, wanted)
        assert (one is None) == (other is None)
        if one is None or other is None:
            continue
        error, _ = target.error_and_jacobian(both.kinematics, one)
        assert target.is_exact(error)
        assert one == pytest.approx(other, abs=1e-4)
        assert plain.eccentricity(one) <= plain.eccentricity(wanted) + 1e-9


def test_self_motion_towards_a_target_with_tolerances_is_left_to_python(both: Both):
    pose = both.kinematics.tool(both.rows[0])
    assert both.compiled.knows_centring(ToolTarget(pose.position))
    assert not both.compiled.knows_centring(ToolTarget(pose.position, position_tolerance=0.01))
    assert not both.plain.knows_centring(ToolTarget(pose.position))
