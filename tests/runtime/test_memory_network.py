"""The in-memory network can lose its router, as the real one can."""

from __future__ import annotations

from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.schemas.topics import EVERY, LATCHED, LATEST


def test_a_network_that_is_away_loses_the_latest_and_keeps_the_rest() -> None:
    network = MemoryNetwork()
    reader, writer = MemoryBus(network), MemoryBus(network)
    heard: list[Arrival] = []
    publications = []
    for delivery in (LATEST, EVERY, LATCHED):
        reader.subscribe(delivery.value, delivery, heard.append, lambda count: None)
        publications.append(writer.publish(delivery.value, "Text", delivery))
    writer.serve("plan", lambda query: query.reply("Text", b""))
    network.is_connected = False
    for publication in publications:
        publication.put(b"1")
        publication.put(b"2")
    assert heard == []
    assert not reader.is_connected
    assert not reader.wait_served("plan", 0.01)
    answers: list[object] = []
    reader.ask("plan", "Text", b"", 1.0, answers.append)
    assert answers == [UNREAD]
    network.is_connected = True
    assert sorted((arrival.key, arrival.payload) for arrival in heard if arrival.key == "every") == [
        ("every", b"1"), ("every", b"2"),
    ]  # fmt: skip
    assert [arrival.payload for arrival in heard if arrival.key == "latched"][-1] == b"2"
    assert not [arrival for arrival in heard if arrival.key == "latest"]
    assert reader.wait_served("plan", 0.01)
