"""A goal that was sent before and is sent again, by its client or by another one, never moves the arm."""

from __future__ import annotations

import msgspec
import pytest
from msgspec.structs import replace

from gemelo.libraries.runtime.actions import keys
from gemelo.libraries.runtime.actions.goal_registry import GoalRecord, GoalRegistry
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import CancelRequest, GoalRequest, GoalResponse, GoalStatusCode, GoalStatuses, ResultRequest
from gemelo.schemas.message import encode
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW
from tests.runtime.support import Buses, until
from tests.runtime.test_actions import Arm, goal_of, moving


def request_of(goal_id: str, arm: Arm) -> GoalRequest:
    goal = msgspec.Raw(encode(goal_of(3)))
    return GoalRequest(goal_id=goal_id, client="operator", goal=goal, epoch=arm.server.epoch)


def send(node: Node, request: GoalRequest) -> GoalResponse:
    return node.call(keys.goal_request(FOLLOW), request)


def has_ended(node: Node, goal_id: str) -> bool:
    asked = ResultRequest(goal_id=goal_id, wait=2.0)
    return node.call(keys.result_request(FOLLOW), asked, timeout=3.0).status is GoalStatusCode.SUCCEEDED


def is_forgotten(node: Node, goal_id: str) -> bool:
    asked = ResultRequest(goal_id=goal_id)
    return node.call(keys.result_request(FOLLOW), asked).status is GoalStatusCode.UNKNOWN


def test_a_goal_that_has_ended_and_is_sent_again_by_another_client_moves_nothing(buses: Buses) -> None:
    with moving(buses) as arm:
        owner, other = buses.node("owner"), buses.node("other")
        first = send(owner, request_of("g", arm))
        assert has_ended(owner, "g")
        moved = arm.moved
        assert send(other, request_of("g", arm)) == first
        assert not arm.left
        assert arm.moved == moved


def test_a_goal_that_is_forgotten_and_sent_again_is_refused_and_a_new_one_is_not(
    buses: Buses, monkeypatch: pytest.MonkeyPatch
) -> None:
    with moving(buses) as arm:
        owner, other = buses.node("owner"), buses.node("other")
        assert send(owner, request_of("g", arm)).accepted
        assert has_ended(owner, "g")
        moved = arm.moved
        monkeypatch.setattr("gemelo.libraries.runtime.actions.goal_registry.KEPT", -1.0)
        assert until(lambda: is_forgotten(owner, "g"))
        again = send(other, request_of("g", arm))
        assert not again.accepted
        assert "has ended already" in again.reason
        assert arm.moved == moved
        assert send(other, request_of("new", arm)).accepted
        assert until(lambda: arm.moved == 2 * moved)


def test_a_goal_that_was_refused_stays_refused_when_it_could_be_carried_out_later(buses: Buses) -> None:
    with moving(buses) as arm:
        owner, other = buses.node("owner"), buses.node("other")
        arm.is_busy = True
        first = send(owner, request_of("g", arm))
        arm.is_busy = False
        assert (first.accepted, first.reason) == (False, "not now")
        assert send(other, request_of("g", arm)) == first
        assert arm.moved == 0


def test_every_try_of_a_goal_that_its_client_has_cancelled_is_refused(buses: Buses) -> None:
    with moving(buses) as arm:
        client = buses.node("client")
        client.call(keys.cancel_request(FOLLOW), CancelRequest(goal_id="g"))
        tries = [send(client, request_of("g", arm)) for _ in range(2)]
        assert [each.reason for each in tries] == ["it was cancelled before it was looked at"] * 2
        assert arm.moved == 0


def test_a_goal_from_before_a_restart_of_its_server_moves_nothing_whether_or_not_it_was_carried_out_then(
    buses: Buses,
) -> None:
    owner, other = buses.node("owner"), buses.node("other")
    with moving(buses) as arm:
        done, late = request_of("g", arm), request_of("late", arm)
        assert send(owner, done).accepted
        assert has_ended(owner, "g")
    arm.node.close()
    with moving(buses) as arm:
        for node in (owner, other):
            for request in (done, late):
                again = send(node, request)
                assert not again.accepted
                assert "a stepper_gateway that was started anew since" in again.reason
        assert arm.moved == 0
        assert not arm.left


def test_a_client_from_before_a_restart_of_the_server_moves_it_as_before_with_a_new_goal(buses: Buses) -> None:
    client = buses.node("client").action(FOLLOW)
    for _ in range(3):
        with moving(buses) as arm:
            assert client.send(goal_of(3)).wait(3.0).status is GoalStatusCode.SUCCEEDED
        arm.node.close()


def test_a_goal_that_names_no_epoch_is_taken_and_one_of_another_is_not(buses: Buses) -> None:
    with moving(buses) as arm:
        node = buses.node("client")
        told = node.call(keys.result_request(FOLLOW), ResultRequest()).epoch
        refused = send(node, replace(request_of("g", arm), epoch=told ^ 1))
        assert (refused.accepted, arm.moved) == (False, 0)
        assert "started anew since" in str(refused.reason)
        assert send(node, replace(request_of("h", arm), epoch=0)).accepted
        assert send(node, replace(request_of("i", arm), epoch=told)).accepted


def test_the_ids_that_are_remembered_are_bounded_and_the_oldest_goes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.libraries.runtime.actions.goal_registry.MAX_DECIDED", 3)
    goals = GoalRegistry()
    for number in range(5):
        goals.add(GoalRecord(str(number), "c", GoalResponse(accepted=True)))
        goals.refuse(str(number), GoalResponse(reason=str(number)))
    assert [goals.response_to(str(number)) is not None for number in range(5)] == [False, False, True, True, True]
    assert goals.statuses.goals == GoalStatuses().goals
