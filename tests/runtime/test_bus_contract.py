"""The contract of every bus, whatever carries it."""

from __future__ import annotations

import threading
import time
from queue import SimpleQueue

from gemelo.libraries.runtime.bus.interface import UNREAD, Arrival, BusReply, Query
from gemelo.libraries.runtime.bus.zenoh_bus import HEARTBEAT
from gemelo.schemas.topics import EVERY, LATCHED, LATEST
from tests.runtime.support import Buses, until


def ignore(count: int) -> None:
    pass


def test_a_message_arrives_with_its_key_schema_bytes_and_signature(buses: Buses) -> None:
    for delivery in (LATEST, EVERY, LATCHED):
        heard: list[Arrival] = []
        key = f"joint_states/{delivery.value}"
        buses.open().subscribe(key, delivery, heard.append, ignore)
        unsigned = buses.open().publish(key, "JointState", delivery)
        signed = buses.open().publish(key, "JointState", delivery, "planner", "1.2.here")
        buses.settle()
        unsigned.put(b"\x80")
        assert until(lambda heard=heard: heard)
        signed.put(b"\x81")
        assert until(lambda heard=heard: len(heard) == 2)
        assert heard == [
            Arrival(key, "JointState", b"\x80"), Arrival(key, "JointState", b"\x81", "planner", "1.2.here")
        ]  # fmt: skip


def test_every_keeps_order_and_loses_nothing_in_a_flood(buses: Buses) -> None:
    heard: list[bytes] = []
    buses.open().subscribe("commands", EVERY, lambda arrival: heard.append(arrival.payload), ignore)
    publication = buses.open().publish("commands", "CommandChunk", EVERY)
    buses.settle()
    sent = [index.to_bytes(4, "big") * 50 for index in range(20_000)]
    for payload in sent:
        publication.put(payload)
    assert until(lambda: len(heard) == len(sent), 60.0)
    assert heard == sent


def test_a_late_joiner_gets_the_last_latched_message_and_nothing_else(buses: Buses) -> None:
    writer = buses.open()
    latched, every = writer.publish("description", "Text", LATCHED), writer.publish("events", "Text", EVERY)
    for payload in (b"old", b"new"):
        latched.put(payload)
        every.put(payload)
    heard: list[bytes] = []
    late = buses.open()
    late.subscribe("description", LATCHED, lambda arrival: heard.append(arrival.payload), ignore)
    late.subscribe("events", EVERY, lambda arrival: heard.append(arrival.payload), ignore)
    assert until(lambda: heard)
    time.sleep(2.5 * HEARTBEAT)  # a reader then learns how much it has missed
    every.put(b"newest")
    assert until(lambda: b"newest" in heard)
    assert heard == [b"new", b"newest"]


def test_a_latched_reader_also_hears_a_writer_that_comes_later(buses: Buses) -> None:
    heard: list[bytes] = []
    buses.open().subscribe("description", LATCHED, lambda arrival: heard.append(arrival.payload), ignore)
    publication = buses.open().publish("description", "Text", LATCHED)
    publication.put(b"one")
    assert until(lambda: heard == [b"one"])
    publication.put(b"two")
    assert until(lambda: heard == [b"one", b"two"])


def test_own_publications_are_heard_only_where_asked_for(buses: Buses) -> None:
    for delivery in (LATEST, EVERY, LATCHED):
        bus = buses.open()
        key = f"log/{delivery.value}"
        foreign: list[bytes] = []
        own: list[bytes] = []
        bus.subscribe(key, delivery, lambda arrival, heard=foreign: heard.append(arrival.payload), ignore)
        bus.subscribe(key, delivery, lambda arrival, heard=own: heard.append(arrival.payload), ignore, own=True)
        bus.publish(key, "LogRecord", delivery).put(b"x")
        assert until(lambda own=own: own == [b"x"])
        time.sleep(0.05)
        assert foreign == []


def test_a_closed_subscription_hears_nothing_more(buses: Buses) -> None:
    heard: list[bytes] = []
    subscription = buses.open().subscribe("events", EVERY, lambda arrival: heard.append(arrival.payload), ignore)
    publication = buses.open().publish("events", "DeviceEvent", EVERY)
    buses.settle()
    publication.put(b"1")
    assert until(lambda: heard)
    subscription.close()
    publication.put(b"2")
    time.sleep(0.1)
    assert heard == [b"1"]


def test_robots_do_not_hear_one_another(buses: Buses) -> None:
    heard: list[bytes] = []
    buses.open("parol6").subscribe("events", EVERY, lambda arrival: heard.append(arrival.payload), ignore)
    buses.open("rm1").publish("events", "DeviceEvent", EVERY).put(b"1")
    buses.open("rm1").declare_alive("@alive/planner")
    time.sleep(0.1)
    assert heard == []
    assert buses.open("parol6").alive("@alive/*") == set()


def ask(bus: object, key: str, payload: bytes, timeout: float = 5.0) -> BusReply | None:
    answers: SimpleQueue[BusReply | None] = SimpleQueue()
    bus.ask(key, "Question", payload, timeout, answers.put)
    return answers.get(timeout=timeout + 1.0)


def test_a_request_gets_one_answer_from_any_thread(buses: Buses) -> None:
    def answer(query: Query) -> None:
        if query.arrival.payload == b"later":
            threading.Timer(0.05, query.reply, ("BusReply", b"late")).start()
        elif query.arrival.payload == b"no":
            query.fail("Failure", b"why")
        else:
            query.reply("BusReply", query.arrival.schema.encode())

    buses.open().serve("plan", answer)
    client = buses.open()
    assert client.wait_served("plan", 5.0)
    assert ask(client, "plan", b"x") == BusReply(True, "BusReply", b"Question")
    assert ask(client, "plan", b"later") == BusReply(True, "BusReply", b"late")
    assert ask(client, "plan", b"no") == BusReply(False, "Failure", b"why")


def test_a_request_without_an_answer_ends_in_time(buses: Buses) -> None:
    kept: list[Query] = []
    buses.open().serve("plan", kept.append)
    client = buses.open()
    assert client.wait_served("plan", 5.0)
    begin = time.monotonic()
    assert ask(client, "plan", b"", timeout=0.3) is None
    assert 0.2 < time.monotonic() - begin < 3.0
    assert not client.wait_served("nobody", 0.1)
    assert ask(client, "nobody", b"") == UNREAD


def test_a_dropped_request_ends_at_once_without_an_answer(buses: Buses) -> None:
    buses.open().serve("plan", lambda query: query.drop())
    client = buses.open()
    assert client.wait_served("plan", 5.0)
    begin = time.monotonic()
    assert ask(client, "plan", b"x", timeout=10.0) == UNREAD
    assert time.monotonic() - begin < 5.0


def test_who_asks_is_known_before_what(buses: Buses) -> None:
    """Limits look at the client of a query only: no schema and no payload has been read by then."""
    kept: list[Query] = []
    buses.open().serve("plan", kept.append)
    one, other = buses.open(), buses.open()
    for client in (one, one, other):
        assert client.wait_served("plan", 5.0)
        count = len(kept)
        client.ask("plan", "Question", b"x", 5.0, lambda answer: None)
        assert until(lambda count=count: len(kept) == count + 1)
    first, second, third = (query.client for query in kept)
    assert first == second != third


def test_wait_served_wakes_when_a_server_comes_and_knows_when_it_is_gone(buses: Buses) -> None:
    client, server = buses.open(), buses.open()
    threading.Timer(0.2, server.serve, ("plan", lambda query: query.reply("BusReply", b""))).start()
    begin = time.monotonic()
    assert client.wait_served("plan", 20.0)
    assert 0.1 < time.monotonic() - begin < 5.0
    server.close()
    assert until(lambda: not client.wait_served("plan", 0.0))


def test_tokens_live_as_long_as_their_bus(buses: Buses) -> None:
    planner, gateway, observer = buses.open(), buses.open(), buses.open()
    planner.declare_alive("@alive/planner")
    token = gateway.declare_alive("@alive/stepper_gateway")
    assert until(lambda: observer.alive("@alive/*") == {"@alive/planner", "@alive/stepper_gateway"})
    token.close()
    assert until(lambda: observer.alive("@alive/*") == {"@alive/planner"})
    planner.close()
    assert until(lambda: observer.alive("@alive/*") == set())


def test_a_watch_hears_of_a_token_that_is_there_and_of_its_end(buses: Buses) -> None:
    client, server = buses.open(), buses.open()
    before, after, other = [], [], []
    client.declare_alive("@id/script/1")
    server.watch_alive("@id/script/1", before.append)
    server.watch_alive("@id/script/2", after.append)
    closed = server.watch_alive("@id/script/2", other.append)
    assert until(lambda: before == [True])
    token = client.declare_alive("@id/script/2")
    assert until(lambda: after == [True] and other == [True])
    closed.close()
    token.close()
    assert until(lambda: after == [True, False])
    client.close()
    assert until(lambda: before == [True, False])
    assert other == [True]


def test_a_watch_of_a_pattern_names_every_token_that_is_there_comes_and_ends(buses: Buses) -> None:
    client, server = buses.open(), buses.open()
    seen: list[tuple[str, bool]] = []
    client.declare_alive("@id/script/a/1")
    closed = server.watch_tokens("@id/script/a/*", lambda key, is_there: seen.append((key, is_there)))
    assert until(lambda: seen == [("@id/script/a/1", True)])
    client.declare_alive("@id/script/b/1")
    token = client.declare_alive("@id/script/a/2")
    assert until(lambda: len(seen) == 2)
    token.close()
    assert until(lambda: len(seen) == 3)
    assert seen[1:] == [("@id/script/a/2", True), ("@id/script/a/2", False)]
    closed.close()
