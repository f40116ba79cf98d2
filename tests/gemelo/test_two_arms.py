"""Several arms in one script, simulated in one time."""

from __future__ import annotations

import pytest

import gemelo


def test_two_arms_move_at_once_in_one_script() -> None:
    with gemelo.simulate("rm1", "parol6") as arms:
        assert [arm.name for arm in arms] == ["rm1", "parol6"]
        motions = [arm.start(named="left", speed=0.5) for arm in arms]
        assert not any(motion.is_over for motion in motions)
        for arm, motion in zip(arms, motions, strict=True):
            assert motion.wait().status is gemelo.GoalStatusCode.SUCCEEDED
            assert arm.joints == pytest.approx(motion.stopped_at, abs=1e-9)
            for joint in arm.description.joints:
                goal = arm.states["left"][joint.name]
                assert abs(arm.joints[joint.name] - goal) <= 0.501 / joint.steps.per_unit


def test_an_offset_keeps_the_orientation_where_an_arm_can_turn_its_tool() -> None:
    with gemelo.simulate("parol6") as arm:
        arm.move(named="ready")
        before = arm.pose()
        arm.line(offset=(0.0, 0.0, 0.02), speed=0.05)
        after = arm.pose()
    assert after.position == pytest.approx(before.offset(z=0.02).position, abs=5e-4)
    assert abs(sum(a * b for a, b in zip(before.orientation, after.orientation, strict=True))) > 0.9999
