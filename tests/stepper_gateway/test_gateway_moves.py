"""Moves on the real firmware core: exact to half a step, in their own time, spliced and cancelled within limits."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import COMMAND_ACKS, COMMANDS, JOINT_STATES, STEP_ERRORS
from gemelo.services.stepper_gateway.goals.active_goal import ActiveGoal
from gemelo.services.stepper_gateway.goals.goal_validator import GoalValidator
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import assert_within_limits, move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)


def expected_steps(position: tuple[float, ...]) -> tuple[int, ...]:
    return tuple((joint.steps.to_q8(p) + 128) >> 8 for joint, p in zip(rm1().joints, position, strict=True))


def execution_near_its_end(bound: JointTolerance) -> tuple[ActiveGoal, StateFrame]:
    """A goal whose joints are on their last step, the first still at 1 step/s."""
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, READY), goal_tolerance=(bound,))
    joints = rm1().joints
    checked = GoalValidator(joints, 25_000).check(goal, 0, GatewayParameters())
    state = StateFrame(t_us=1, mode=2, steps=expected_steps(READY), velocity=(1.0, 0.0, 0.0))
    return ActiveGoal("g", checked, joints, Moment(0, 0.0)), state


def test_a_move_ends_on_the_exact_steps() -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    status, result = rig.finish()
    assert status == GoalStatusCode.SUCCEEDED
    assert result.executed_steps == rig.device.steps == expected_steps(READY)
    assert all(abs(error) <= 0.5 for error in result.final_error)
    assert all(error <= 0.505 for error in result.max_following_error)
    assert rig.executing == ["g"]
    assert_within_limits(rig)


@pytest.mark.parametrize("half", [-34.5, -33.5, 33.5, 34.5])
def test_a_move_that_ends_on_half_a_step_says_the_steps_that_the_device_makes_of_it(half: float) -> None:
    rig = VirtualArm().ready()
    goal = (0.0, half / rm1().joints[1].steps.per_unit, 0.0)
    assert rig.goal(move(HOME, goal)).accepted
    status, result = rig.finish()
    assert status == GoalStatusCode.SUCCEEDED
    assert result.commanded_steps == result.executed_steps == rig.device.steps
    assert abs(result.final_error[1]) == 0.5


def test_the_log_says_what_moved_where_how_long_and_with_what_error() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY))
    result = rig.finish()[1]
    (line,) = [line for line in rig.log if line.startswith("goal g ")]
    assert line.startswith(f"goal g succeeded after {result.duration:.2f} s; brazo_joint from +0.0000 to +0.6000 rad, ")
    assert "efector_joint from +0.0000 to +0.0799 m; " in line
    assert f"{max(map(abs, result.final_error)):.2f} steps from the goal at most (" in line
    assert any(line.startswith("motion started: from brazo_joint +0.0000 rad, ") for line in rig.log)
    assert any(line.startswith("motion finished: at brazo_joint +0.6") for line in rig.log)
    rig.goal(move(READY, HOME), "h")
    rig.run(0.3)
    rig.handle(CancelInput("h"))
    rig.finish("h")
    assert any(": the arm decelerated on its path; brazo_joint from +0.6" in line for line in rig.log)


def test_every_state_is_within_half_a_step_of_the_command() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY))
    rig.finish()
    errors = rig.messages(STEP_ERRORS)
    assert max(abs(error) for message in errors for error in message.error) <= 0.505
    assert len(rig.messages(JOINT_STATES)) >= 50 * 3


def test_the_first_chunk_leaves_with_the_acceptance() -> None:
    rig = VirtualArm().ready()
    before = len(rig.sent)
    rig.goal(move(HOME, READY))
    assert rig.sent[before][1] == "traj"


def test_a_lossy_wire_loses_nothing() -> None:
    rig = VirtualArm(VirtualWire(delay=0.003, jitter=0.008, loss=0.1, duplicates=0.2), seed=5).ready()
    places = [READY, (-0.5, 0.8, 0.02), (1.0, 0.0, 0.15), HOME]
    here = HOME
    for index, place in enumerate(places):
        assert rig.goal(move(here, place), f"g{index}").accepted
        assert rig.finish(f"g{index}")[0] == GoalStatusCode.SUCCEEDED
        assert rig.device.steps == expected_steps(place)
        here = rig.position
    assert_within_limits(rig)
    sent = {(chunk.stream, chunk.seq) for chunk in rig.messages(COMMANDS)}
    assert len(rig.messages(COMMANDS)) > len(sent)  # some went twice
    assert {(ack.stream, ack.seq) for ack in rig.messages(COMMAND_ACKS)} <= sent


def test_a_streamed_move_keeps_what_is_left_of_the_last_command() -> None:
    """The seed's relative `move()` ended a 90 degree command after 48 and 4 steps; absolute knots end on the target."""
    rig = VirtualArm().ready()
    quarter = 1.5707963267948966
    for index in range(60):
        rig.target(brazo_joint=quarter * min(1.0, index / 20), antebrazo_joint=quarter * min(1.0, index / 20))
        rig.run(0.1)
    assert rig.device.steps[:2] == expected_steps((quarter, quarter, 0.0))[:2] == (4666, 100)
    assert rig.messages(STEP_ERRORS)[-1].executed == rig.device.steps


def test_a_goal_and_a_target_without_all_joints_move_what_they_name() -> None:
    """The seed's firmware ignored every message that lacked q3, silently."""
    rig = VirtualArm().ready()
    whole = move(HOME, READY)
    partial = JointTrajectory(
        joint_names=whole.joint_names[:2],
        points=tuple(
            TrajectoryPoint(positions=p.positions[:2], time_from_start=p.time_from_start) for p in whole.points
        ),
    )
    assert rig.goal(partial, "partial").accepted
    assert rig.finish("partial")[0] is GoalStatusCode.SUCCEEDED
    assert rig.device.steps == expected_steps((*READY[:2], 0.0))
    for _ in range(30):
        rig.target(brazo_joint=0.2, antebrazo_joint=0.1)
        rig.run(0.1)
    assert rig.device.steps == expected_steps((0.2, 0.1, 0.0))


def slow_points(count: int, spacing: float) -> JointTrajectory:
    """Positions only, `spacing` seconds apart, along a gentle smooth way."""
    share = [(3 * u * u - 2 * u**3) for u in (i / (count - 1) for i in range(count))]
    return JointTrajectory(
        joint_names=rm1().joint_names,
        points=tuple(
            TrajectoryPoint(positions=(0.4 * s, -0.3 * s, 0.01 * s), time_from_start=i * spacing)
            for i, s in enumerate(share)
        ),
    )


def test_points_100_ms_apart_take_their_own_time() -> None:
    rig = VirtualArm().ready()
    trajectory = slow_points(31, 0.1)
    begun = rig.now
    assert rig.goal(trajectory).accepted
    status, result = rig.finish()
    assert status == GoalStatusCode.SUCCEEDED
    assert 3.0 <= rig.now - begun <= 3.2
    assert 3.0 <= result.duration <= 3.2
    assert rig.device.steps == expected_steps((0.4, -0.3, 0.01))
    assert_within_limits(rig)


def test_success_is_never_said_before_the_device_has_executed_the_steps() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY))
    while "g" not in rig.finished:
        executed = rig.device.steps
        rig.run(0.001)
    assert executed == expected_steps(READY)
    assert rig.core.controller.stream is not None
    assert rig.core.controller.stream.acked == rig.core.controller.stream.next_seq


def test_without_a_device_a_goal_is_refused_not_simulated() -> None:
    rig = VirtualArm()
    rig.device_is_on = False
    rig.drop()
    rig.run(1.0)
    verdict = rig.goal(move(HOME, READY))
    assert not verdict.accepted
    assert verdict.code == FollowErrorCode.DEVICE_FAILED
    assert '"rm1"' in verdict.reason


def test_cancel_decelerates_on_the_path_within_the_limits() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY))
    rig.run(1.5)
    assert rig.handle(CancelInput("g")).why is None
    status, result = rig.finish()
    assert status == GoalStatusCode.CANCELED
    assert result.error_code == FollowErrorCode.CANCELED
    assert result.executed_steps == rig.device.steps
    assert_within_limits(rig)
    share = [s / t for s, t in zip(rig.device.steps, expected_steps(READY), strict=True)]
    assert max(share) - min(share) < 0.02  # still on the straight line of the move
    here = rig.position
    rig.run(1.0)
    assert rig.position == here


def test_a_cancel_at_once_and_one_at_the_end_both_end_the_goal() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY), "early")
    assert rig.handle(CancelInput("early")).why is None
    assert rig.finish("early", 5.0)[0] == GoalStatusCode.CANCELED
    rig.goal(move(rig.position, READY), "late")
    stream = rig.core.controller.stream
    assert stream is not None
    rig.run(20.0, lambda: stream.is_complete)
    rig.run(0.2)
    assert rig.handle(CancelInput("late")).why is None
    assert rig.finish("late", 5.0)[0] == GoalStatusCode.CANCELED
    assert rig.handle(CancelInput("late")).why == because("goal.not_under_way", goal="late")
    assert_within_limits(rig)


def test_a_new_goal_is_spliced_continuously_in_velocity() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, (1.2, -1.2, 0.08)), "first")
    rig.run(1.5)
    speed = abs(rig.path[-1][0] - rig.path[-2][0])
    assert speed > 0.1
    splice = len(rig.path)
    now_at = rig.messages(JOINT_STATES)[-1].position
    assert rig.goal(move(now_at, (-0.5, 0.5, 0.01)), "second").accepted
    assert rig.finished["first"][0] == GoalStatusCode.PREEMPTED
    assert rig.finish("second")[0] == GoalStatusCode.SUCCEEDED
    assert rig.device.steps == expected_steps((-0.5, 0.5, 0.01))
    assert_within_limits(rig)
    # Nowhere between the two goals did the arm stand still but at its turning point.
    still = sum(a == b for a, b in zip(rig.path[splice:], rig.path[splice + 1 : -300], strict=False))
    assert still <= 5


def test_many_goals_after_another_keep_the_limits() -> None:
    rig = VirtualArm(seed=9).ready()
    for index in range(12):
        here = rig.messages(JOINT_STATES)[-1].position
        goal = (rig.rng.uniform(-1, 1), rig.rng.uniform(-1, 1), rig.rng.uniform(0.0, 0.15))
        verdict = rig.goal(move(here, goal), f"g{index}")
        assert verdict.accepted, verdict.reason
        rig.run(rig.rng.uniform(0.05, 1.5))
    assert rig.finish("g11")[0] == GoalStatusCode.SUCCEEDED
    assert [rig.finished[f"g{i}"][0] for i in range(11)] == [GoalStatusCode.PREEMPTED] * 11
    assert rig.device.steps == expected_steps(goal)
    assert_within_limits(rig)


def test_a_goal_that_arrives_while_the_last_knots_are_played_starts_after_them() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, (0.2, -0.2, 0.02)), "first")
    stream = rig.core.controller.stream
    assert stream is not None
    assert rig.run(10.0, lambda: stream.is_complete)
    here = rig.messages(JOINT_STATES)[-1].position
    assert rig.goal(move(here, (0.5, 0.1, 0.05)), "second").accepted
    assert rig.finished["first"][0] == GoalStatusCode.PREEMPTED
    assert rig.finish("second")[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)


def test_a_goal_that_starts_elsewhere_while_moving_is_refused_and_the_move_goes_on() -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, READY), "first")
    rig.run(1.0)
    verdict = rig.goal(move((-0.5, 0.0, 0.0), HOME), "second")
    assert not verdict.accepted
    assert "brazo_joint" in verdict.reason
    assert rig.finish("first")[0] == GoalStatusCode.SUCCEEDED


def test_a_single_point_is_reached_in_the_time_given() -> None:
    rig = VirtualArm().ready()
    point = TrajectoryPoint(positions=(0.5, 0.2, 0.01), time_from_start=3.0)
    begun = rig.now
    assert rig.goal(JointTrajectory(joint_names=rm1().joint_names, points=(point,))).accepted
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert rig.now - begun == pytest.approx(3.0, abs=0.08)
    assert rig.device.steps == expected_steps(point.positions)
    assert_within_limits(rig)


def test_a_stamp_in_the_future_starts_then() -> None:
    rig = VirtualArm().ready()
    plan = move(HOME, READY)
    later = JointTrajectory(stamp=rig.moment.unix + 1_000_000_000, joint_names=plan.joint_names, points=plan.points)
    assert rig.goal(later).accepted
    rig.run(0.9)
    assert rig.device.steps == (0, 0, 0)
    assert not rig.device.moving
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_a_goal_where_the_arm_already_is_succeeds() -> None:
    rig = VirtualArm().ready()
    point = TrajectoryPoint(positions=HOME, velocities=HOME, time_from_start=0.0)
    assert rig.goal(JointTrajectory(joint_names=rm1().joint_names, points=(point,))).accepted
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_feedback_comes_20_times_a_second_and_names_the_point() -> None:
    rig = VirtualArm().ready()
    plan = move(HOME, READY)
    rig.goal(plan)
    rig.finish()
    duration = plan.points[-1].time_from_start
    assert 18 * duration <= len(rig.feedback) <= 21 * duration
    assert [f.index for f in rig.feedback] == sorted(f.index for f in rig.feedback)
    assert rig.feedback[-1].points == len(plan.points)
    assert max(abs(e) for f in rig.feedback for e in f.error.positions[:1]) < 0.001


def test_a_goal_tolerance_below_what_steps_can_do_is_violated_by_name_and_number() -> None:
    rig = VirtualArm().ready()
    goal = FollowJointTrajectoryGoal(
        trajectory=move(HOME, (0.6001, -1.203, 0.0801)),
        goal_tolerance=(JointTolerance(name="antebrazo_joint", position=1e-6),),
        goal_time_tolerance=0.5,
    )
    assert rig.goal(goal).accepted
    status, result = rig.finish()
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.GOAL_TOLERANCE_VIOLATED)
    assert "antebrazo_joint" in result.error_string
    assert "steps" in result.error_string


@pytest.mark.parametrize("velocity", [0.0, -1.0, 0.05])
def test_a_velocity_tolerance_that_the_arm_keeps_or_that_is_none_changes_nothing(velocity: float) -> None:
    rig = VirtualArm().ready()
    bound = (JointTolerance(name="brazo_joint", velocity=velocity, acceleration=min(velocity, 0.0)),)
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, READY), path_tolerance=bound, goal_tolerance=bound)
    assert rig.goal(goal).accepted
    assert rig.finish()[0] is GoalStatusCode.SUCCEEDED


def test_a_velocity_off_its_path_tolerance_names_joint_error_and_time_and_decelerates() -> None:
    rig = VirtualArm().ready()
    goal = FollowJointTrajectoryGoal(
        trajectory=move(HOME, READY), path_tolerance=(JointTolerance(name="brazo_joint", velocity=1e-9),)
    )
    assert rig.goal(goal).accepted
    status, result = rig.finish()
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.PATH_TOLERANCE_VIOLATED)
    assert 'joint "brazo_joint" is' in result.error_string
    assert "rad/s off its velocity at" in result.error_string
    assert "more than 1e-09 rad/s" in result.error_string
    assert_within_limits(rig)


def test_a_goal_whose_joint_still_moves_is_not_reached_within_a_velocity_tolerance() -> None:
    """Its position has been within the tolerance long before its velocity is."""
    bound = JointTolerance(name="brazo_joint", position=10.0, velocity=1e-6)
    execution, state = execution_near_its_end(bound)
    assert not execution.is_reached(state)
    assert execution.is_reached(replace(state, velocity=(0,) * len(state.velocity)))
    loose = JointTolerance(name="brazo_joint", position=10.0, velocity=100.0)
    assert execution_near_its_end(loose)[0].is_reached(state)


def test_a_path_tolerance_violation_names_joint_error_and_time_and_decelerates() -> None:
    rig = VirtualArm().ready()
    goal = FollowJointTrajectoryGoal(
        trajectory=move(HOME, READY), path_tolerance=(JointTolerance(name="brazo_joint", position=1e-5),)
    )
    assert rig.goal(goal).accepted
    status, result = rig.finish()
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.PATH_TOLERANCE_VIOLATED)
    assert "brazo_joint" in result.error_string
    assert_within_limits(rig)
