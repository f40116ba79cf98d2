"""Things that come at an odd moment: every goal still ends, for the right reason, and the next one works."""

from __future__ import annotations

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, OutputCommand, ReferenceCommand
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.topics import DEVICE_STATE, JOINT_STATES
from gemelo.services.stepper_gateway.device.clock import ENOUGH, ClockSync
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import assert_within_limits, move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)


def moving_rig() -> VirtualArm:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    assert rig.device.moving
    return rig


def here(rig: VirtualArm) -> tuple[float, ...]:
    position: tuple[float, ...] = rig.messages(JOINT_STATES)[-1].position
    return position


def later(rig: VirtualArm, plan: JointTrajectory, seconds: float) -> JointTrajectory:
    stamp = rig.moment.unix + round(seconds * 1e9)
    return JointTrajectory(stamp=stamp, joint_names=plan.joint_names, points=plan.points)


def rig_with_a_goal_that_waits() -> VirtualArm:
    """The first goal's last knots are under way, so the second one has to wait for their end."""
    rig = VirtualArm().ready()
    rig.goal(move(HOME, (0.2, -0.2, 0.02)), "first")
    stream = rig.core.controller.stream
    assert stream is not None
    assert rig.run(10.0, lambda: stream.is_complete)
    assert rig.goal(move(here(rig), (0.5, 0.1, 0.05)), "second").accepted
    assert "second" not in rig.finished
    return rig


def assert_next_goal_succeeds(rig: VirtualArm) -> None:
    assert rig.run(5.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    verdict = rig.goal(move(here(rig), (0.1, 0.1, 0.05)), "next")
    assert verdict.accepted, verdict.reason
    status, result = rig.finish("next", 20.0)
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert_within_limits(rig)


def test_a_heartbeat_lost_after_a_resume_still_ends_the_goal() -> None:
    rig = moving_rig()
    rig.command(DeviceCommandKind.HOLD, 1)
    rig.run(2.0)
    rig.command(DeviceCommandKind.RESUME, 2)
    rig.run(0.5)
    assert rig.device.mode == DeviceMode.RUN
    rig.device.halt()  # as a lost heartbeat does
    status, result = rig.finish(seconds=3.0)
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
    assert_next_goal_succeeds(rig)


def test_a_goal_with_little_time_to_spare_survives_hold_and_resume() -> None:
    rig = VirtualArm().ready()
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, READY), goal_time_tolerance=0.15)
    assert rig.goal(goal).accepted
    rig.run(1.2)
    rig.command(DeviceCommandKind.HOLD, 1)
    rig.run(3.0)
    rig.command(DeviceCommandKind.RESUME, 2)
    status, result = rig.finish()
    assert status == GoalStatusCode.SUCCEEDED, result.error_string


def test_a_hold_whose_answer_is_lost_is_still_a_persons_hold() -> None:
    rig = moving_rig()
    rig.command(DeviceCommandKind.HOLD, 1)
    for _ in range(100):
        rig.run(0.02)
        rig.drop("cmd/ack")
    rig.run(2.0)
    assert rig.device.mode == DeviceMode.HOLD
    assert not rig.finished
    rig.command(DeviceCommandKind.RESUME, 2)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_a_stop_while_a_goal_waits_ends_it_and_lets_the_next_one_begin() -> None:
    rig = rig_with_a_goal_that_waits()
    rig.command(DeviceCommandKind.STOP, 1)
    status, result = rig.finish("second", 3.0)
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
    assert_next_goal_succeeds(rig)


def test_a_lost_heartbeat_ends_a_goal_that_waits() -> None:
    rig = rig_with_a_goal_that_waits()
    rig.device.halt()  # as a lost heartbeat does
    status, _ = rig.finish("second", 3.0)
    assert status == GoalStatusCode.ABORTED
    assert_next_goal_succeeds(rig)


def test_a_lost_link_while_a_goal_waits_leaves_no_motion_behind() -> None:
    rig = rig_with_a_goal_that_waits()
    rig.device.halt()
    rig.link(False)
    assert rig.finish("second", 3.0)[0] == GoalStatusCode.ABORTED
    rig.run(1.0)
    rig.link(True)
    assert_next_goal_succeeds(rig)


def test_canceling_a_goal_that_waits_behind_a_motion_stops_the_motion() -> None:
    rig = rig_with_a_goal_that_waits()
    assert rig.handle(CancelInput("second")).why is None
    assert rig.finish("second", 3.0)[0] == GoalStatusCode.CANCELED
    assert not rig.device.moving
    assert_next_goal_succeeds(rig)


def test_a_canceled_goal_stays_canceled_when_a_stamped_one_comes_due_meanwhile() -> None:
    rig = moving_rig()
    assert rig.goal(later(rig, move(here(rig), HOME), 0.2), "stamped").accepted
    assert rig.handle(CancelInput("g")).why is None
    assert rig.finish()[0] == GoalStatusCode.CANCELED
    assert rig.finish("stamped")[0] in (GoalStatusCode.ABORTED, GoalStatusCode.SUCCEEDED)
    assert_next_goal_succeeds(rig)


def test_a_stamped_goal_that_is_canceled_leaves_streaming_as_it_was() -> None:
    rig = VirtualArm().ready()
    for _ in range(10):
        rig.target(brazo_joint=0.3)
        rig.run(0.1)
    assert rig.goal(later(rig, move(here(rig), HOME), 30.0), "stamped").accepted
    rig.run(0.1)
    assert rig.handle(CancelInput("stamped")).why is None
    rig.run(3.0)
    assert rig.device.mode == DeviceMode.IDLE
    for _ in range(40):
        rig.target(brazo_joint=-0.2)
        rig.run(0.1)
    assert abs(here(rig)[0] + 0.2) < 0.001


def test_a_goal_spliced_into_a_stream_that_stands_begins_where_that_stands() -> None:
    rig = VirtualArm().ready()
    for _ in range(40):
        rig.target(brazo_joint=0.2, antebrazo_joint=0.2066)
        rig.run(0.1)
    assert rig.device.mode == DeviceMode.RUN
    point = TrajectoryPoint(positions=here(rig), velocities=HOME, time_from_start=0.0)
    assert rig.goal(JointTrajectory(joint_names=rm1().joint_names, points=(point,))).accepted
    status, result = rig.finish(seconds=5.0)
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert_within_limits(rig)
    assert_next_goal_succeeds(rig)


def test_a_late_chunk_of_a_stopped_stream_ends_the_goal_that_it_disturbs() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY), "old")
    late = rig.drop("traj")
    assert rig.handle(CancelInput("old")).why is None
    assert rig.finish("old", 2.0)[0] == GoalStatusCode.CANCELED
    rig.device.receive(late[0])
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, READY), goal_time_tolerance=-1.0)
    assert rig.goal(goal, "new").accepted
    rig.drop("traj")
    assert rig.finish("new", 5.0)[0] == GoalStatusCode.ABORTED
    assert_next_goal_succeeds(rig)


def test_a_goal_does_not_overtake_a_persons_stop() -> None:
    rig = VirtualArm().ready()
    rig.command(DeviceCommandKind.STOP, 1)
    rig.drop("cmd")  # lost; it will be sent again
    verdict = rig.goal(move(HOME, READY))
    assert not verdict.accepted
    assert "STOP" in verdict.reason
    rig.run(0.3)
    assert rig.answers[1].accepted
    assert_next_goal_succeeds(rig)


def test_a_goal_right_after_the_answer_to_a_stop_waits_until_the_arm_stands() -> None:
    rig = VirtualArm().ready()
    for _ in range(10):
        rig.target(brazo_joint=1.0)
        rig.run(0.1)
    rig.command(DeviceCommandKind.STOP, 1)
    assert rig.run(1.0, lambda: 1 in rig.answers)
    verdict = rig.goal(move(here(rig), READY))
    if verdict.accepted:
        assert rig.finish()[0] in (GoalStatusCode.SUCCEEDED, GoalStatusCode.ABORTED)
    assert_next_goal_succeeds(rig)


def test_an_arm_on_its_limit_is_within_its_limits() -> None:
    rig = VirtualArm().ready()
    joint = rm1().joints[1]
    assert joint.steps.to_position(rig_steps := round(joint.steps.to_steps(joint.upper))) > joint.upper
    assert rig.goal(move(HOME, (0.0, joint.upper, 0.0))).accepted
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert rig.device.steps[1] == rig_steps
    assert here(rig)[1] == joint.upper
    rig.new_gateway()
    rig.ready()
    assert_next_goal_succeeds(rig)


def test_a_goal_without_a_bound_in_time_does_not_wait_for_steps_that_will_not_come() -> None:
    rig = VirtualArm().ready()
    goal = FollowJointTrajectoryGoal(
        trajectory=move(HOME, (0.6001, -1.203, 0.0801)),
        goal_tolerance=(JointTolerance(name="antebrazo_joint", position=1e-6),),
        goal_time_tolerance=-1.0,
    )
    assert rig.goal(goal).accepted
    status, result = rig.finish(seconds=10.0)
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.GOAL_TOLERANCE_VIOLATED)
    assert "antebrazo_joint" in result.error_string
    assert_next_goal_succeeds(rig)


def test_the_clock_is_found_again_after_this_machine_has_slept() -> None:
    clock = ClockSync()
    for index in range(20):
        t0 = index * 500_000
        clock.add(t0, t0 + 1_000_500, t0 + 1_000_500, t0 + 1000)
    asleep = 60_000_000
    for index in range(ENOUGH):
        assert bool(index) == clock.is_contradicted
        t0 = (20 + index) * 500_000
        clock.add(t0, t0 + asleep + 1_001_500, t0 + asleep + 1_001_500, t0 + 3000)
    assert clock.is_synchronised
    assert not clock.is_contradicted
    assert abs(clock.device_time(t0 * 1e-6) - (t0 + asleep + 1_000_000)) < 3000


@pytest.mark.parametrize("wait", [0.0, 0.003, 0.006, 0.009, 0.012, 0.015, 0.018])
def test_what_was_answered_is_true_for_whoever_acts_on_the_answer_at_once(wait: float) -> None:
    rig = VirtualArm(referenced=False).ready()
    rig.run(wait)  # the states come every 20 ms
    assert not rig.goal(move(HOME, READY), "too early").accepted
    rig.ask(ReferenceCommand(name=rm1().joint_names, position=HOME), 1)
    assert rig.run(1.0, lambda: 1 in rig.answers)
    assert rig.answers[1].accepted
    assert rig.messages(DEVICE_STATE)[-1].referenced == (True, True, True)
    verdict = rig.goal(move(HOME, READY))
    assert verdict.accepted, verdict.reason
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_an_answer_does_not_wait_for_states_that_do_not_come() -> None:
    rig = VirtualArm().ready()
    rig.lost.add(Kind.STATE)
    since = rig.now
    rig.ask(OutputCommand(output="avanzar", on=True), 1)
    assert rig.run(1.0, lambda: 1 in rig.answers)
    assert rig.answers[1].accepted
    assert rig.now - since < 0.3
