"""Of two nodes with one name the older gives way; one that was stopped is silent until it knows; time is given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.identity import Identity, identify
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.name_holder import AGAIN, BACK, STAYS, STOPPED, NameHolder, StopWatch
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection

OLDER, OWN, NEWER = (Identity("planner", started, "desk", 7) for started in (1, 2, 3))


def test_a_newer_node_of_the_name_that_stays_ends_the_older_one() -> None:
    holder = NameHolder(OWN)
    holder.on_token(NEWER.key, True, 10.0)
    assert holder.objection(10.0 + 0.9 * STAYS) == ""
    said = holder.objection(10.0 + 1.1 * STAYS)
    assert said.startswith('another node named "planner" has started since this one (process 7 on desk)')


@pytest.mark.parametrize("key", [OLDER.key, OWN.key, "@id/local/planner/*", "@id/local/planner/99"])
def test_neither_an_older_node_nor_what_is_no_nodes_token_ends_one(key: str) -> None:
    holder = NameHolder(OWN)
    holder.on_token(key, True, 10.0)
    assert holder.objection(20.0) == ""
    assert holder.newer == ""


def test_a_second_node_that_gives_way_at_its_start_ends_nobody() -> None:
    holder = NameHolder(OWN)
    holder.on_token(NEWER.key, True, 10.0)
    holder.on_token(NEWER.key, False, 10.2)
    assert holder.objection(20.0) == ""


def turns(watch: StopWatch, start: float, seconds: float, connected: bool = True, newer: str = "") -> list[bool]:
    """Of 50 a second from `start` [s] on."""
    return [watch.is_certain(start + i / 50, lambda: connected, lambda: newer) for i in range(round(seconds * 50))]


def test_a_node_that_was_stopped_is_certain_of_its_name_only_after_the_router_has_it_back() -> None:
    watch = StopWatch()
    assert all(turns(watch, 0.0, 5.0))
    assert all(turns(watch, 5.0 + 0.9 * STOPPED, 1.0)), "a busy machine is no stop"
    assert not any(turns(watch, 10.0, 3.0, connected=False))
    assert not any(turns(watch, 13.0, BACK - 0.1))
    assert all(turns(watch, 13.0 + BACK, 1.0)[1:])
    after = turns(watch, 20.0, 3.0)
    assert 50 * max(AGAIN, BACK) <= after.index(True) <= 50 * max(AGAIN, BACK) + 2
    assert all(after[after.index(True) :])


def test_a_node_that_was_stopped_never_is_certain_beside_one_that_has_taken_its_place() -> None:
    watch = StopWatch()
    turns(watch, 0.0, 1.0)
    assert not any(turns(watch, 5.0, 10.0, newer=NEWER.key))


def test_the_older_of_two_nodes_ends_its_spin_with_the_sentence(tmp_path: Path) -> None:
    network = MemoryNetwork()
    deployment = Deployment(paths=PathsSection(out=str(tmp_path / "out"), run=str(tmp_path / "run")))
    with Node("planner", deployment, robot="rm1", bus=MemoryBus(network), stop=ShutdownRequest()) as node:
        newer = replace(identify("planner"), pid=4711, host="desk")
        MemoryBus(network).declare_alive(newer.key)  # as of a process that this one had been taken for dead by
        with pytest.raises(NodeNameTaken, match=r"has started since this one \(process 4711 on desk\)"):
            node.spin()
