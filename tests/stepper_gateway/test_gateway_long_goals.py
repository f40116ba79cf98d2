"""Goals of as many points as the limit says are taken, and what is above it is refused with number and remedy."""

from __future__ import annotations

import math

import pytest

from gemelo.libraries.runtime.bus.wire import encoded
from gemelo.schemas.device import GatewayInputs
from gemelo.schemas.motion import MOST_POINTS, FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.input_log import InputLog
from gemelo.services.stepper_gateway.inputs import BeganInput, GoalInput, unpacked
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm


def wave(points: int, arm: VirtualArm, with_velocities: bool) -> FollowJointTrajectoryGoal:
    """A slow wave of one joint in knots of 20 ms, from rest to rest, from where the arm stands."""
    names, here = arm.arm.joint_names, arm.arm.reference_position
    rate = 2.0 * math.pi / (0.02 * points)  # [rad/s] one wave in all

    def point(index: int) -> TrajectoryPoint:
        t = 0.02 * (index + 1)
        off, speed = 0.05 * (1.0 - math.cos(rate * t)), 0.05 * rate * math.sin(rate * t)
        velocities = (*(0.0 for _ in names[:-1]), speed if index < points - 1 else 0.0) if with_velocities else ()
        return TrajectoryPoint(positions=(*here[:-1], here[-1] + off), velocities=velocities, time_from_start=t)

    return FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(joint_names=names, points=tuple(map(point, range(points))))
    )


@pytest.mark.parametrize("points", [10_000, 50_000])
@pytest.mark.parametrize("with_velocities", [True, False], ids=["cubic", "linear"])
def test_a_goal_of_many_points_is_accepted_and_begun(points: int, with_velocities: bool) -> None:
    arm = VirtualArm().ready()
    verdict = arm.goal(wave(points, arm, with_velocities))
    assert verdict.accepted, verdict.reason
    before = arm.position[-1]
    assert arm.run(20.0, lambda: arm.position[-1] > before)


def test_a_goal_of_more_points_than_the_limit_is_refused_with_number_and_remedy() -> None:
    arm = VirtualArm().ready()
    verdict = arm.goal(wave(MOST_POINTS + 1, arm, False))
    assert not verdict.accepted
    assert verdict.reason == f"the trajectory has {MOST_POINTS + 1} points, more than {MOST_POINTS}; send it in parts"


def test_large_goals_one_after_the_other_are_recorded_in_messages_that_fit_and_come_back_the_same() -> None:
    arm, messages = VirtualArm(), list[GatewayInputs]()
    began = BeganInput(1, GatewayParameters())
    log = InputLog(arm.core, began, arm.moment, messages.append)
    goals = [GoalInput(f"g{index}", wave(MOST_POINTS // 4, arm, True)) for index in range(3)]
    for goal in goals:
        log.handle(goal, arm.moment)
    log.finish()
    assert [given.input for message in messages for given in unpacked(message.inputs)] == [began, *goals]
    assert all(encoded(message) for message in messages)
    assert len(messages) == 3
