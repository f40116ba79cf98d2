"""A goal that follows another begins at its end, in the same stream: the arm does not wait between them."""

from __future__ import annotations

from itertools import pairwise

import pytest
from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import StopKind
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowErrorCode, FollowJointTrajectoryGoal
from gemelo.schemas.topics import COMMANDS, JOINT_STATES
from gemelo.tools.virtual_arm.gateway_driver import CancelInput, SceneInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import assert_within_limits, move
from tests.stepper_gateway.test_gateway_moves import HOME, READY, expected_steps

FARTHER = (1.0, -0.8, 0.05)
THIRD = (0.4, 0.3, 0.02)


def follows(start: Vector, end: Vector, after: str, scene: int | None = None) -> FollowJointTrajectoryGoal:
    return FollowJointTrajectoryGoal(trajectory=move(start, end), after=after, scene_version=scene)


def started(seconds: float = 0.5) -> VirtualArm:
    """An arm on its way from HOME to READY, as goal `first`."""
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY), "first").accepted
    rig.run(seconds)
    return rig


def test_it_begins_in_the_slot_in_which_the_one_before_ends() -> None:
    rig = started()
    assert rig.goal(follows(READY, FARTHER, "first"), "second").accepted
    assert rig.finish("first")[0] == GoalStatusCode.SUCCEEDED
    status, result = rig.finish("second")
    assert status == GoalStatusCode.SUCCEEDED
    assert result.executed_steps == rig.device.steps == expected_steps(FARTHER)
    assert_within_limits(rig)

    both = move(HOME, READY).points[-1].time_from_start + move(READY, FARTHER).points[-1].time_from_start
    moving = [index for index, (before, after) in enumerate(pairwise(rig.path)) if before != after]
    assert (moving[-1] - moving[0]) * 1e-3 <= both + 0.002


def test_the_goal_that_is_passed_succeeds_with_what_was_executed_there() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    status, result = rig.finish("first")
    assert status == GoalStatusCode.SUCCEEDED
    assert max(map(abs, result.final_error)) <= 0.5
    assert all(abs(a - b) <= 20 for a, b in zip(result.executed_steps, expected_steps(READY), strict=True))
    assert rig.executing[-1] == "second"
    assert rig.feedback[-1].points == len(move(HOME, READY).points)
    rig.run(0.2)
    assert rig.feedback[-1].points == len(move(READY, FARTHER).points)


def test_a_chain_of_goals_moves_without_a_pause() -> None:
    rig = started()
    places = [READY, FARTHER, THIRD, READY, HOME]
    for index, (start, end) in enumerate(pairwise(places)):
        after = "first" if index == 0 else f"g{index - 1}"
        assert rig.run(20.0, lambda after=after: after in rig.executing)
        verdict = rig.goal(follows(start, end, after), f"g{index}")
        assert verdict.accepted, verdict.reason
    assert rig.finish("g3")[0] == GoalStatusCode.SUCCEEDED
    assert len({row.stream for row in rig.messages(COMMANDS)}) == 1
    assert_within_limits(rig)


@pytest.mark.parametrize("seconds", [0.0, 0.1, 0.3, 0.6, 1.0])
def test_whenever_it_comes_before_or_just_after_the_end_it_follows(seconds: float) -> None:
    rig = started(0.0)
    stream = rig.core.controller.stream
    assert stream is not None
    assert rig.run(20.0, lambda: stream.is_complete)
    rig.run(seconds)
    assert rig.goal(follows(READY, FARTHER, "first"), "second").accepted
    assert rig.finish("second")[0] == GoalStatusCode.SUCCEEDED
    assert rig.finished["first"][0] == GoalStatusCode.SUCCEEDED
    assert rig.device.steps == expected_steps(FARTHER)
    assert_within_limits(rig)


@pytest.mark.parametrize(
    ("goal", "said"),
    [
        (follows(READY, FARTHER, "nobody"), "goal nobody cannot be followed, it is not under way"),
        (
            follows(HOME, FARTHER, "first"),
            'joint "brazo_joint": the trajectory starts at 0.0000 rad, the arm is at 0.6',
        ),
        (replace(follows(READY, FARTHER, "first"), trajectory=replace(move(READY, FARTHER), stamp=10**18)), "stamp"),
    ],
)
def test_what_cannot_follow_is_refused_and_the_move_goes_on(goal: FollowJointTrajectoryGoal, said: str) -> None:
    rig = started()
    goal = replace(goal, trajectory=replace(goal.trajectory, stamp=rig.moment.unix if goal.trajectory.stamp else 0))
    verdict = rig.goal(goal, "second")
    assert not verdict.accepted
    assert said in verdict.reason
    assert rig.finish("first")[0] == GoalStatusCode.SUCCEEDED


def test_only_one_goal_follows() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    verdict = rig.goal(follows(READY, THIRD, "first"), "third")
    assert not verdict.accepted
    assert "goal second follows goal first already" in verdict.reason


def test_a_goal_that_ended_otherwise_is_not_followed() -> None:
    rig = started()
    rig.handle(CancelInput("first"))
    assert "is not under way" in rig.goal(follows(READY, FARTHER, "first"), "second").reason or not rig.finished
    rig.finish("first")
    verdict = rig.goal(follows(READY, FARTHER, "first"), "third")
    assert not verdict.accepted
    assert "it ended CANCELED" in verdict.reason


@pytest.mark.parametrize("seconds", [0.3, 1.6])  # before its knots are sent, and while they are
def test_when_the_first_is_cancelled_the_second_does_not_begin(seconds: float) -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    rig.run(seconds)
    rig.handle(CancelInput("first"))
    assert rig.finish("first")[0] == GoalStatusCode.CANCELED
    status, result = rig.finished["second"]
    assert status == GoalStatusCode.ABORTED
    assert result.error_string.startswith("goal first, which it was to follow, canceled")
    rig.run(1.0)
    assert not rig.device.moving
    assert_within_limits(rig)


def test_a_following_goal_is_taken_back_before_its_knots_are_sent() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    assert rig.handle(CancelInput("second")).why is None
    assert rig.finished["second"][0] == GoalStatusCode.CANCELED
    assert rig.finish("first")[0] == GoalStatusCode.SUCCEEDED
    assert rig.device.steps == expected_steps(READY)


def test_a_following_goal_whose_knots_are_on_their_way_is_cancelled_as_it_begins() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    transmission = rig.core.controller.transmission
    assert rig.run(20.0, lambda: not transmission.has_following)
    assert "first" not in rig.finished
    assert rig.handle(CancelInput("second")).why is None
    assert rig.finish("second")[0] == GoalStatusCode.CANCELED
    assert rig.finished["first"][0] == GoalStatusCode.SUCCEEDED
    rig.run(1.0)
    assert not rig.device.moving
    assert rig.device.steps != expected_steps(FARTHER)
    assert_within_limits(rig)


def test_an_ordinary_goal_takes_over_from_both() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    here = rig.messages(JOINT_STATES)[-1].position
    assert rig.goal(move(here, THIRD), "third").accepted
    assert rig.finished["first"][0] == GoalStatusCode.PREEMPTED
    assert rig.finished["second"][0] == GoalStatusCode.ABORTED
    assert rig.finish("third")[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)


def test_a_stop_of_a_person_ends_both() -> None:
    rig = started()
    rig.goal(follows(READY, FARTHER, "first"), "second")
    rig.ask(StopKind.STOP)
    assert rig.finish("first")[0] == GoalStatusCode.ABORTED
    assert rig.finished["second"][0] == GoalStatusCode.ABORTED


def test_a_scene_that_changes_before_it_begins_ends_it_and_not_the_first() -> None:
    rig = started()
    rig.handle(SceneInput(4, 1))
    assert rig.goal(follows(READY, FARTHER, "first", scene=4), "second").accepted
    rig.handle(SceneInput(5, 1))
    status, result = rig.finish("second", 0.1)
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.SCENE_CHANGED)
    assert rig.finish("first")[0] == GoalStatusCode.SUCCEEDED
