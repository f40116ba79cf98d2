"""Actions: goals, feedback, results, cancelling, several clients, and servers that vanish."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import msgspec
import pytest

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.actions.server import ActionServer, GoalDecision, accept, refuse
from gemelo.libraries.runtime.errors import GoalRefused, NoAnswer, RequestRefused, ServerLost
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.actions import GoalStatusCode, ResultRequest
from gemelo.schemas.message import encode
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTrajectory,
)
from gemelo.schemas.reasons import Reason, plain
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW
from tests.runtime.support import Buses, hear, spinning, until

Result = FollowJointTrajectoryResult
Server = ActionServer[FollowJointTrajectoryGoal, FollowJointTrajectoryFeedback, FollowJointTrajectoryResult]


class Arm:
    """A server that 'moves' for as many steps of 10 ms as the goal names joints; a new goal preempts."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.left: dict[str, int] = {}
        self.moved = 0
        self.is_busy = False
        self.server: Server = node.serve_action(FOLLOW, self.on_goal, self.on_cancel)

    def on_goal(self, goal_id: str, goal: FollowJointTrajectoryGoal) -> GoalDecision:
        if not goal.trajectory.joint_names:
            return refuse(FollowErrorCode.INVALID_JOINTS, "the trajectory names no joint")
        if self.is_busy:
            return refuse(FollowErrorCode.INVALID_JOINTS, "not now")
        for running in list(self.left):
            self.end(running, GoalStatusCode.PREEMPTED)
        self.left[goal_id] = len(goal.trajectory.joint_names)
        return accept()

    def on_cancel(self, goal_id: str) -> Reason | None:
        if self.left[goal_id] > 10_000:
            return plain("it cannot be stopped any more")
        self.left[goal_id] = -1
        return None

    def end(self, goal_id: str, status: GoalStatusCode) -> None:
        del self.left[goal_id]
        self.server.finish(goal_id, status, Result(error_string=status.name))

    def step(self, now: int) -> None:
        for goal_id, left in list(self.left.items()):
            self.moved += 1
            self.server.executing(goal_id)
            self.server.feedback(goal_id, FollowJointTrajectoryFeedback(index=left))
            if left < 0:
                self.end(goal_id, GoalStatusCode.CANCELED)
            elif left == 0:
                self.end(goal_id, GoalStatusCode.SUCCEEDED)
            else:
                self.left[goal_id] = left - 1


def goal_of(steps: int) -> FollowJointTrajectoryGoal:
    return FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=("q",) * steps))


@contextmanager
def moving(buses: Buses) -> Iterator[Arm]:
    arm = Arm(buses.node("stepper_gateway"))
    with spinning(arm.node, arm.step, rate=100.0):
        yield arm


def test_a_goal_gives_all_feedback_in_order_and_then_its_result(buses: Buses) -> None:
    seen: list[int] = []
    with moving(buses):
        client = buses.node("client").action(FOLLOW)
        handle = client.send(goal_of(20), on_feedback=lambda feedback: seen.append(feedback.index))
        outcome = handle.wait(60.0)
    assert outcome.status is GoalStatusCode.SUCCEEDED
    assert outcome.result == Result(error_string="SUCCEEDED")
    assert seen == list(range(20, -1, -1))


def test_a_refusal_carries_the_code_and_the_reason(buses: Buses) -> None:
    with moving(buses):
        client = buses.node("client").action(FOLLOW)
        with pytest.raises(GoalRefused, match="names no joint") as refusal:
            client.send(goal_of(0))
    assert refusal.value.code == FollowErrorCode.INVALID_JOINTS


def test_cancel_ends_the_goal_as_canceled(buses: Buses) -> None:
    with moving(buses):
        handle = buses.node("client").action(FOLLOW).send(goal_of(10_000))
        ticks: list[float] = []

        def on_tick() -> None:
            ticks.append(time.monotonic())
            if len(ticks) == 3:
                handle.cancel()

        assert handle.wait(3.0, on_tick).status is GoalStatusCode.CANCELED
    assert len(ticks) >= 3


def test_a_refused_cancel_lets_the_goal_go_on(buses: Buses) -> None:
    with moving(buses) as arm:
        handle = buses.node("client").action(FOLLOW).send(goal_of(20_000))
        handle.cancel()
        with pytest.raises(NoAnswer, match="has not ended within"):
            handle.wait(0.2)
        assert handle.status is GoalStatusCode.EXECUTING
        assert handle.cancel_refused == "it cannot be stopped any more"
        arm.left.clear()


def test_a_second_client_preempts_and_both_hear_their_own_end(buses: Buses) -> None:
    with moving(buses):
        first = buses.node("first").action(FOLLOW).send(goal_of(10_000))
        second = buses.node("second").action(FOLLOW).send(goal_of(5))
        assert first.wait(60.0).status is GoalStatusCode.PREEMPTED
        assert second.wait(60.0).status is GoalStatusCode.SUCCEEDED


def test_another_client_can_cancel_everything(buses: Buses) -> None:
    with moving(buses):
        handle = buses.node("first").action(FOLLOW).send(goal_of(10_000))
        assert buses.node("second").action(FOLLOW).cancel_all() == (handle.goal_id,)
        assert handle.wait(60.0).status is GoalStatusCode.CANCELED


def test_a_client_that_vanishes_does_not_stop_the_motion(buses: Buses) -> None:
    with moving(buses) as arm:
        client = buses.node("client")
        client.action(FOLLOW).send(goal_of(30))
        client.close()
        assert until(lambda: arm.moved == 31 and not arm.left)


def test_an_attached_goal_is_cancelled_when_its_client_vanishes(buses: Buses) -> None:
    with moving(buses) as arm:
        client, other = buses.node("client"), buses.node("other")
        handle = client.action(FOLLOW).send(goal_of(10_000), attached=True)
        status = other.latest(keys.status_topic(FOLLOW))
        assert hear(other, lambda: status.message is not None and status.message.goals[0].status == 2)
        client.close()
        assert hear(other, lambda: status.message.goals[0].status is GoalStatusCode.CANCELED)
        assert not arm.left
        assert status.message.goals[0].goal_id == handle.goal_id


def test_an_attached_goal_runs_to_its_end_while_its_client_lives(buses: Buses) -> None:
    with moving(buses):
        client = buses.node("client").action(FOLLOW)
        for steps in (250, 3):  # of 10 ms: the first is longer than a client without a token would be given
            assert client.send(goal_of(steps), attached=True).wait(10.0).status is GoalStatusCode.SUCCEEDED


def test_a_result_is_kept_for_who_asks_later(buses: Buses) -> None:
    with moving(buses):
        node = buses.node("client")
        handle = node.action(FOLLOW).send(goal_of(3))
        time.sleep(0.3)
        answer = node.call(keys.result_request(FOLLOW), ResultRequest(goal_id=handle.goal_id))
        assert answer.status is GoalStatusCode.SUCCEEDED
        assert handle.wait(60.0).status is GoalStatusCode.SUCCEEDED
        assert handle.wait(0.0).status is GoalStatusCode.SUCCEEDED


def test_the_answer_to_a_result_request_can_be_held_back(buses: Buses) -> None:
    with moving(buses):
        node = buses.node("client")
        handle = node.action(FOLLOW).send(goal_of(30))
        answer = node.call(keys.result_request(FOLLOW), ResultRequest(goal_id=handle.goal_id, wait=2.0), timeout=3.0)
        assert answer.status is GoalStatusCode.SUCCEEDED
        unknown = node.call(keys.result_request(FOLLOW), ResultRequest(goal_id="x", wait=2.0))
        assert unknown.status is GoalStatusCode.UNKNOWN


def test_the_same_goal_sent_twice_is_accepted_once(buses: Buses) -> None:
    from gemelo.schemas.actions import GoalRequest

    with moving(buses) as arm:
        node = buses.node("client")
        goal = msgspec.Raw(encode(goal_of(10)))
        request = GoalRequest(goal_id="twice", client="c", goal=goal, epoch=arm.server.epoch)
        first = node.call(keys.goal_request(FOLLOW), request)
        assert node.call(keys.goal_request(FOLLOW), request) == first
        assert until(lambda: arm.moved == 11)


def test_without_a_server_a_goal_is_not_sent(buses: Buses) -> None:
    begin = time.monotonic()
    with pytest.raises(NoAnswer, match="is stepper_gateway running"):
        buses.node("client").action(FOLLOW).send(goal_of(1), timeout=0.5)
    assert time.monotonic() - begin < 5.0


def test_a_server_that_falls_silent_is_lost_within_seconds(buses: Buses) -> None:
    with moving(buses) as arm:
        handle = buses.node("client").action(FOLLOW).send(goal_of(10_000))
        arm.node.stop()
        begin = time.monotonic()
        with pytest.raises(ServerLost, match="stepper_gateway has been silent"):
            handle.wait(60.0)
        assert time.monotonic() - begin < 10.0


def test_a_restarted_server_does_not_know_the_goal(buses: Buses) -> None:
    with moving(buses) as arm:
        handle = buses.node("client").action(FOLLOW).send(goal_of(10_000))
    arm.node.close()
    with moving(buses), pytest.raises(ServerLost, match="restarted"):
        handle.wait(60.0)


def test_a_client_that_was_busy_itself_does_not_give_up(buses: Buses, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gemelo.libraries.runtime.actions.goal_handle.SERVER_TIMEOUT", 0.8)
    with moving(buses):
        node = buses.node("client")
        handle = node.action(FOLLOW).send(goal_of(110))
        time.sleep(1.0)
        node.wait(0.05)
        assert not handle.is_over
        assert handle.wait(60.0).status is GoalStatusCode.SUCCEEDED


def test_a_node_that_spins_follows_its_goals_too(buses: Buses) -> None:
    with moving(buses):
        node = buses.node("tour")
        client = node.action(FOLLOW)
        with spinning(node):
            handle = client.send(goal_of(5))
            assert until(lambda: handle.outcome is not None)
            assert handle.wait(60.0).status is GoalStatusCode.SUCCEEDED


def test_goals_that_are_no_goals_are_refused_and_nothing_dies(buses: Buses) -> None:
    from msgspec import Raw

    from gemelo.schemas.actions import CancelRequest, GoalRequest

    with moving(buses) as arm:
        node = buses.node("client")
        for goal in (Raw(b"\xc0"), Raw(b"\x93\x01\x02\x03"), Raw(b"\x81\xaatrajectory\x05")):
            with pytest.raises(RequestRefused, match="FollowJointTrajectoryGoal") as refusal:
                node.call(keys.goal_request(FOLLOW), GoalRequest(goal_id="x", goal=goal, epoch=arm.server.epoch))
            assert refusal.value.kind == "bad request"
        with pytest.raises(RequestRefused, match="needs an id"):
            node.call(keys.goal_request(FOLLOW), GoalRequest(epoch=arm.server.epoch))
        assert node.call(keys.cancel_request(FOLLOW), CancelRequest()).reason == "no goal is active"
        assert "no such goal" in node.call(keys.cancel_request(FOLLOW), CancelRequest(goal_id="x")).reason
        assert arm.moved == 0
        assert node.action(FOLLOW).send(goal_of(1)).wait(2.0).status is GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize("client", ["", "a//b", "@id/*/*/*", "@id/local/cli-1/*", "@alive/local/cli-1"])
def test_an_attached_goal_of_a_client_whose_end_nobody_would_see_is_refused(buses: Buses, client: str) -> None:
    from gemelo.schemas.actions import GoalRequest

    with moving(buses) as arm:
        node, goal = buses.node("client"), msgspec.Raw(encode(goal_of(10)))
        request = GoalRequest(goal_id="x", client=client, attached=True, goal=goal, epoch=arm.server.epoch)
        with pytest.raises(RequestRefused, match="names the liveliness token of its client"):
            node.call(keys.goal_request(FOLLOW), request)
        assert arm.server.active == ()
