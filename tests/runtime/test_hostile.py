"""Hostile messages on any key: each is dropped or refused, counted, and nothing dies."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.actions.server import accept
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.endpoints import info_request, parameter_request, parameters_request
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.requests.client import response_in
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.schemas.message import decode
from gemelo.schemas.system import Failure
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, PLAN, TOPICS
from tests.runtime.support import hear

KEYS = st.sampled_from([topic.key for topic in TOPICS])
ASKED = st.sampled_from(
    [PLAN.key, *(make("victim").key for make in (parameter_request, parameters_request, info_request))]
    + [f"{FOLLOW_JOINT_TRAJECTORY.key}/{part}" for part in ("goal", "cancel", "result")]
)
SCHEMAS = st.sampled_from(
    sorted(
        {topic.message.__name__ for topic in TOPICS}
        | {"", "PlanRequest", "PlanResponse", "GoalRequest", "SetParameter", "Empty"}
    )
)
NESTED = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=12), inner, max_size=3),
    max_leaves=6,
)
BIG = b"in place of a megabyte"  # which would not be readable in a report
PAYLOADS = st.binary(max_size=100) | NESTED.map(msgspec.msgpack.encode) | st.just(BIG)


@pytest.fixture(scope="module")
def network() -> MemoryNetwork:
    return MemoryNetwork()


@pytest.fixture(scope="module")
def victim(network: MemoryNetwork, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Node]:
    folder = str(tmp_path_factory.mktemp("victim"))
    deployment = Deployment(paths=PathsSection(run=folder, out=folder))
    with Node("victim", deployment, robot="rm1", bus=MemoryBus(network), log_level="error") as node:
        for topic in TOPICS:
            node.subscribe(topic, lambda message: None)
        node.serve(PLAN, lambda request: PLAN.response())
        server = node.serve_action(FOLLOW_JOINT_TRAJECTORY, lambda goal_id, goal: accept(), lambda goal_id: None)
        assert server.active == ()
        yield node


@given(KEYS, SCHEMAS, PAYLOADS)
def test_a_message_is_handled_or_counted_as_bad(
    network: MemoryNetwork, victim: Node, key: str, schema: str, payload: bytes
) -> None:
    before = counted(victim, key)
    stranger = MemoryBus(network)
    delivery = next(topic.delivery for topic in TOPICS if topic.key == key)
    stranger.publish(key, schema, delivery).put(full_size(payload))
    assert hear(victim, lambda: sum(counted(victim, key)) == sum(before) + 1)
    after = counted(victim, key)
    stranger.close()
    if schema != next(topic.message.__name__ for topic in TOPICS if topic.key == key) or payload == BIG:
        assert after[1] == before[1] + 1


@given(ASKED, SCHEMAS, PAYLOADS)
def test_a_request_is_always_answered(
    network: MemoryNetwork, victim: Node, key: str, schema: str, payload: bytes
) -> None:
    answers: list[BusReply | None] = []
    MemoryBus(network).ask(key, schema, full_size(payload), 5.0, answers.append)
    assert hear(victim, lambda: len(answers) == 1)
    assert answers[0] is not None
    if not answers[0].ok:
        assert decode(Failure, answers[0].payload).message


@given(st.binary(max_size=64), SCHEMAS, st.booleans())
def test_an_answer_is_a_response_a_refusal_or_no_answer(payload: bytes, schema: str, ok: bool) -> None:
    with contextlib.suppress(NoAnswer, RequestRefused):
        assert isinstance(response_in(PLAN, BusReply(ok, schema, payload)), PLAN.response)
        assert schema == PLAN.response.__name__


def full_size(payload: bytes) -> bytes:
    return bytes(1_000_000) if payload == BIG else payload


def counted(node: Node, key: str) -> tuple[int, int]:
    """Good and bad messages of a key."""
    statistics = next(each for each in node.statistics() if each.key == key)
    return statistics.received, statistics.bad
