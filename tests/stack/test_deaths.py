"""kill -9 of every process while a move runs: the arm never jumps, the client is told, the next move works."""

from __future__ import annotations

import subprocess
import time

import pytest
from msgspec.structs import replace

from gemelo.libraries.runtime.actions.keys import goal_request, result_request
from gemelo.libraries.runtime.errors import NoAnswer, ServerLost
from gemelo.schemas.actions import GoalRequest, GoalStatusCode, ResultRequest
from gemelo.schemas.device import ReferenceCommand
from gemelo.schemas.message import decode
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.system import Exchange
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, exchange_topic
from tests.stack.person import jumps

SPEED = 0.6  # slow enough that the kill falls into the middle
BOUND = 15.0  # [s] in which a waiting client must know


def kill_while_moving(stack, operator, name):
    """Kills `name` in the middle of a move; (outcome or what was raised, [s] from kill to that, duration [s])."""
    plan = operator.plan(SPEED)
    handle = operator.send(plan)
    assert operator.wait_for(
        lambda: handle.feedback is not None and handle.feedback.elapsed > 0.3 * plan.duration, 10.0
    )
    stack.kill(name)
    killed = time.monotonic()
    try:
        end = handle.wait(plan.duration + BOUND)
    except (ServerLost, NoAnswer) as error:
        end = error
    return end, time.monotonic() - killed, plan.duration


def test_a_client_that_is_killed_does_not_stop_its_move(stack, operator):
    joint = operator.arm.joints[0]
    operator.move(1.0)
    operator.seen.clear()
    client = subprocess.Popen(
        [stack.root / ".venv/bin/gemelo", "move", "--joints", f"{joint.name}={operator.pose(0.0)[0]}rad"],
        cwd=stack.root,
        env=stack.environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    assert operator.wait_for(operator.is_moving, 60.0)
    client.kill()
    client.wait()
    assert operator.wait_for(lambda: not operator.is_moving(), 60.0)
    assert operator.seen[-1].position[0] == pytest.approx(operator.pose(0.0)[0], abs=1 / joint.steps.per_unit)


@pytest.mark.parametrize("name", ["state_publisher", "planner", "logger", "visualizer"])
def test_a_bystander_that_dies_does_not_disturb_the_move(stack, operator, name):
    outcome, _, _ = kill_while_moving(stack, operator, name)
    assert not isinstance(outcome, Exception), outcome
    assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
    assert outcome.result.executed_steps == outcome.result.commanded_steps
    assert not jumps(operator.arm, operator.seen)
    stack.wait_ready(120.0, [name])
    again, done = operator.move_again()
    assert again.status is GoalStatusCode.SUCCEEDED
    assert done == []


def test_when_the_gateway_dies_the_arm_comes_to_rest_on_its_path_and_the_client_is_told(stack, operator):
    end, seconds, _ = kill_while_moving(stack, operator, "stepper_gateway")
    assert isinstance(end, ServerLost), end
    assert seconds < 5.0
    stack.wait_ready(120.0, ["stepper_gateway"])
    again, _ = operator.move_again()
    assert again.status is GoalStatusCode.SUCCEEDED
    assert not jumps(operator.arm, operator.seen)


def test_a_goal_that_was_heard_before_the_gateway_died_moves_nothing_when_it_is_said_to_the_next_one(stack, operator):
    """The arm stands where that goal begins, so that it could be carried out again; under the new epoch it is."""
    heard: list[Exchange] = []
    operator.node.subscribe(exchange_topic(goal_request(FOLLOW_JOINT_TRAJECTORY)), heard.append)
    operator.move_again()
    for _ in range(2):
        assert operator.move().status is GoalStatusCode.SUCCEEDED
    assert operator.wait_for(lambda: len(heard) >= 3, 60.0)
    there, back = (decode(GoalRequest, bytes(each.question)) for each in heard[-2:])
    assert there.epoch == back.epoch != 0
    stack.kill("stepper_gateway")
    stack.wait_ready(120.0, ["stepper_gateway"])
    operator.free()
    operator.seen.clear()
    for goal in (there, back):
        again = operator.node.call(goal_request(FOLLOW_JOINT_TRAJECTORY), goal)
        assert (again.accepted, "stepper_gateway that was started anew since" in again.reason) == (False, True)
    assert operator.wait_for(lambda: len(operator.seen) >= 50, 60.0)
    assert len({state.position for state in operator.seen}) == 1
    epoch = operator.node.call(result_request(FOLLOW_JOINT_TRAJECTORY), ResultRequest()).epoch
    forged = operator.node.call(goal_request(FOLLOW_JOINT_TRAJECTORY), replace(there, epoch=epoch))
    assert forged.accepted, forged.reason
    assert operator.wait_for(operator.is_moving, 60.0)
    assert operator.wait_for(lambda: not operator.is_moving(), 60.0)


def test_when_the_broker_dies_the_move_ends_with_a_reason_and_the_next_one_works(stack, operator):
    end, seconds, duration = kill_while_moving(stack, operator, "broker")
    assert not isinstance(end, Exception), end
    assert end.status in (GoalStatusCode.SUCCEEDED, GoalStatusCode.ABORTED)
    if end.status is GoalStatusCode.ABORTED:
        assert end.result.error_code is FollowErrorCode.DEVICE_FAILED
        assert end.result.error_string
    assert seconds < duration + BOUND
    assert not jumps(operator.arm, operator.seen)
    stack.wait_ready(120.0)
    again, _ = operator.move_again()
    assert again.status is GoalStatusCode.SUCCEEDED


def test_when_the_router_dies_the_arm_finishes_its_path_and_the_client_learns_it(stack, operator):
    end, seconds, duration = kill_while_moving(stack, operator, "router")
    assert isinstance(end, ServerLost) or end.status is GoalStatusCode.SUCCEEDED, end
    assert seconds < duration + BOUND
    assert not jumps(operator.arm, operator.seen)
    stack.wait_ready(120.0)
    again, done = operator.move_again()
    assert again.status is GoalStatusCode.SUCCEEDED
    assert done == []


def test_a_device_that_reboots_while_moving_fails_the_move_and_must_be_referenced(stack, operator):
    end, seconds, _ = kill_while_moving(stack, operator, "virtual_esp32")
    assert not isinstance(end, Exception), end
    assert end.status is GoalStatusCode.ABORTED
    assert end.result.error_code is FollowErrorCode.DEVICE_FAILED
    assert end.result.error_string
    assert seconds < 5.0
    stack.wait_ready(120.0, ["virtual_esp32", "stepper_gateway"])
    again, done = operator.move_again()
    assert any(isinstance(each, ReferenceCommand) for each in done)
    assert again.status is GoalStatusCode.SUCCEEDED


def test_after_all_of_it_every_process_is_ready_and_nothing_was_raised(stack):
    stack.wait_ready(120.0)
    for name in stack.processes:
        assert "Traceback" not in stack.logs(name), f"{name}: {stack.logs(name)[-2000:]}"
