"""A target while the arm moves: its own motion gives way, and one of its switches' search is said by name."""

from __future__ import annotations

import pytest

import gemelo


def test_a_target_for_an_arm_that_moves_lets_its_motion_rest_and_plans_from_there():
    with gemelo.simulate("rm1") as arm:
        first = arm.start(named="left", speed=0.3)
        arm.sim.sleep(0.3)
        assert not first.is_over
        second = arm.start(named="ready")
        assert first.wait().status is gemelo.GoalStatusCode.CANCELED
        assert second.wait().status is gemelo.GoalStatusCode.SUCCEEDED
        began = second.plan.trajectory.points[0].positions
        names = second.plan.trajectory.joint_names
        assert dict(zip(names, began, strict=True)) == pytest.approx(first.stopped_at, abs=1e-3)
        assert max(abs(error) for error in arm.step_errors.values()) <= 0.5


def test_a_motion_that_waits_behind_another_gives_way_with_it():
    with gemelo.simulate("rm1") as arm:
        first = arm.start(named="left", speed=0.3)
        behind = arm.start(named="lifted", after=first)
        assert arm.start(named="ready").wait().status is gemelo.GoalStatusCode.SUCCEEDED
        assert first.is_over
        assert behind.is_over


def test_a_target_during_a_homing_is_refused_because_the_arm_looks_for_its_switches():
    with gemelo.simulate("rm1", start="unreferenced") as arm:
        refusals: list[gemelo.Refused] = []

        def ask(progress: object) -> None:
            try:
                arm.plan(named="ready")
            except gemelo.Refused as refused:
                refusals.append(refused)

        arm.home(on_progress=ask)
        assert refusals, "no target was refused while it homed"
        assert {refused.check for refused in refusals} == {"homing"}
        assert "the arm is looking for its switches: wait until it is home" in str(refusals[0])
        assert arm.move(named="ready").status is gemelo.GoalStatusCode.SUCCEEDED
