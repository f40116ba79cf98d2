"""The requests of a goal's client to its server: each is sent once, until there is an answer."""

from __future__ import annotations

import pytest

from gemelo.libraries.runtime.actions import keys as keys
from gemelo.libraries.runtime.actions.goal_handle import GoalHandle
from gemelo.libraries.runtime.bus.interface import Query
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.wire import schema_of, to_payload
from gemelo.libraries.runtime.loop.loop import Loop
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.actions import CancelResponse, GoalStatus, GoalStatusCode, GoalStatuses
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY as FOLLOW

GOES_ON = GoalStatuses(stamp=200, goals=(GoalStatus(goal_id="goal", status=GoalStatusCode.EXECUTING),))
ENDED = GoalStatuses(stamp=200, goals=(GoalStatus(goal_id="goal", status=GoalStatusCode.SUCCEEDED),))


@pytest.fixture
def network() -> MemoryNetwork:
    return MemoryNetwork()


def handle(network: MemoryNetwork) -> tuple[GoalHandle, Loop]:
    bus = MemoryBus(network)
    loop = Loop(ShutdownRequest())
    accepted = GoalHandle(FOLLOW, "goal", bus, loop, None)
    accepted.accepted_at(100)
    return accepted, loop


def served(network: MemoryNetwork, key: str) -> list[Query]:
    """The requests under a key, which nobody has answered yet."""
    arrived: list[Query] = []
    MemoryBus(network).serve(key, arrived.append)
    return arrived


def test_while_a_result_is_asked_for_it_is_not_asked_for_again_and_afterwards_it_is(network: MemoryNetwork) -> None:
    arrived = served(network, keys.result_request(FOLLOW).key)
    goal, loop = handle(network)
    for _ in range(3):
        goal.on_status(ENDED)
    assert len(arrived) == 1
    arrived[0].drop()
    loop.wait(0.0)
    assert loop.wait_for(lambda: loop.tasks.is_empty, 5.0)
    goal.on_status(ENDED)
    assert len(arrived) == 2


def test_while_a_cancel_is_under_way_it_is_not_sent_again_and_after_its_answer_never(network: MemoryNetwork) -> None:
    arrived = served(network, keys.cancel_request(FOLLOW).key)
    goal, loop = handle(network)
    for _ in range(3):
        goal.cancel()
    assert len(arrived) == 1
    arrived[0].drop()
    loop.wait(0.0)
    assert loop.wait_for(lambda: loop.tasks.is_empty, 5.0)
    goal.on_status(GOES_ON)
    assert len(arrived) == 2
    arrived[1].reply(schema_of(CancelResponse), to_payload(CancelResponse(reason="it has no brakes")))
    assert loop.wait_for(lambda: bool(goal.cancel_refused), 5.0)
    assert goal.cancel_refused == "it has no brakes"
    goal.on_status(GOES_ON)
    assert len(arrived) == 2
