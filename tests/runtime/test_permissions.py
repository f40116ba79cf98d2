"""Every role tries every key: all passes an open router, and a locked one only what the tables give the role."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from contextlib import closing, suppress
from functools import partial
from itertools import product

import msgspec
import pytest
import zenoh

from gemelo.libraries.runtime.bus.branches import asked_under, read_under, served_under, written_under
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.libraries.runtime.endpoints import parameter_request
from gemelo.libraries.runtime.errors import NoAnswer
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.permissions import ABOUT, SET, Permissions, permissions
from gemelo.libraries.runtime.requests import client as requests
from gemelo.libraries.runtime.running import robots_on
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection
from gemelo.schemas.message import Message
from gemelo.schemas.roles import ROLES, role
from gemelo.schemas.system import SetParameter
from gemelo.schemas.topics import DEVICE_EVENTS, DEVICE_STATUS, TOPICS, Delivery, Topic
from tests.runtime.locks import Lock, LockedRouter, sessions
from tests.runtime.support import ROOT, RouterProcess, spinning, until
from tests.stack import hostile
from tests.stack.hostile import FOREIGN

MAY: dict[str, Permissions] = {each.name: permissions(each) for each in ROLES}
NAMES = tuple(MAY)
SPOKEN = tuple(sorted(set().union(*(may.publishes | may.subscribes for may in MAY.values()))))
ASKED = tuple(sorted(key for key in set().union(*(may.serves for may in MAY.values())) if "@node" not in key))
CACHE = "/@adv/pub/0123456789abcdef/1/_"  # below a key: where its writer keeps what it wrote
TO_ANSWER = 3.0  # [s] for all questions of all roles together
Sessions = dict[str, zenoh.Session]
Pairs = dict[str, set[tuple[str, str]]]  # by key: who was heard or answered by whom


@pytest.fixture(scope="module")
def lock(tmp_path_factory) -> Lock:
    return Lock(tmp_path_factory.mktemp("lock"))


@pytest.fixture(scope="module")
def locked(lock, tmp_path_factory) -> Iterator[Sessions]:
    router = LockedRouter(tmp_path_factory.mktemp("locked"), lock)
    with sessions({name: router.section(name) for name in NAMES}) as opened:
        yield opened
    router.stop()


@pytest.fixture(scope="module")
def unlocked(tmp_path_factory) -> Iterator[Sessions]:
    router = RouterProcess(tmp_path_factory.mktemp("open"))
    with sessions(dict.fromkeys(NAMES, router.deployment.router)) as opened:
        yield opened
    router.stop()


def own_node(name: str) -> str:
    return role(name).node or f"some_{name}"


def heard(opened: Sessions) -> Pairs:
    """By key, the pairs (writer, reader) of which the reader heard the writer: every role listens and speaks."""
    pairs: Pairs = defaultdict(set)
    declared = [
        session.declare_subscriber(
            read_under(key), lambda sample, key=key, name=name: pairs[key].add((sample.payload.to_string(), name)),
            allowed_origin=zenoh.Locality.REMOTE,
        )
        for name, session in opened.items() for key in SPOKEN
    ]  # fmt: skip
    exchange(opened)
    for name, session in opened.items():
        for key in SPOKEN:
            session.put(spoken(key, name), name, congestion_control=zenoh.CongestionControl.BLOCK)
    exchange(opened)
    for each in declared:
        each.undeclare()
    return pairs


def exchange(opened: Sessions) -> None:
    """Every session has a question answered by every other: what was sent before has then arrived, or never will."""
    keys = {name: f"@node/{name}/{own_node(name)}/info" for name in opened}
    served = [opened[name].declare_queryable(served_under(key), answer("here")) for name, key in keys.items()]
    for name, session in opened.items():
        for key in (key for other, key in keys.items() if other != name):
            assert until(partial(is_answered, session, asked_under(key, name))), f"{name} has no answer to {key}"
    for each in served:
        each.undeclare()


def is_answered(session: zenoh.Session, key: str) -> bool:
    return any(reply.ok is not None for reply in session.get(key, timeout=2.0))


def answer(text: str, key: str = "") -> Callable[[zenoh.Query], None]:
    """Under `key`, else under that which is asked for."""

    def reply(query: zenoh.Query) -> None:
        with query:
            query.reply(key or query.key_expr, text)

    return reply


def spoken(key: str, name: str) -> str:
    """The key under which a role's own node writes."""
    return written_under(key, name, own_node(name))


def kept(key: str, name: str) -> str:
    """The key under which a role's own node keeps what it wrote."""
    return spoken(key, name) + CACHE


Named = Callable[[str, str], str]  # the key of an application's key for a role


def answered(
    opened: Sessions,
    keys: tuple[str, ...] = ASKED,
    served_as: Named = lambda key, name: served_under(key),
    asked_as: Named = asked_under,
) -> Pairs:
    """By key, the pairs (server, client) of which the client got the server's answer: every role serves and asks."""
    pairs: Pairs = defaultdict(set)
    served = [
        session.declare_queryable(served_as(key, name), answer(name, served_as(key, name) if served_as is kept else ""))
        for name, session in opened.items() for key in keys
    ]  # fmt: skip
    exchange(opened)
    waiting = threading.Semaphore(0)
    for name, session in opened.items():
        for key in keys:
            ask(
                session, asked_as(key, name), lambda said, key=key, name=name: pairs[key].add((said, name)),
                waiting.release,
            )  # fmt: skip
    for _ in product(opened, keys):
        assert waiting.acquire(timeout=2 * TO_ANSWER)
    for each in served:
        each.undeclare()
    return pairs


def ask(session: zenoh.Session, key: str, on_answer: Callable[[str], object], on_end: Callable[[], None]) -> None:
    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            on_answer(reply.ok.payload.to_string())

    session.get(
        key, zenoh.handlers.Callback(on_reply, on_end), timeout=TO_ANSWER, target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE, allowed_destination=zenoh.Locality.REMOTE,
    )  # fmt: skip


def all_pairs() -> set[tuple[str, str]]:
    return {(one, other) for one, other in product(NAMES, NAMES) if one != other}


def test_where_the_lock_is_open_everybody_speaks_and_hears_on_every_key(unlocked):
    assert heard(unlocked) == dict.fromkeys(SPOKEN, all_pairs())


def test_where_the_lock_is_open_everybody_serves_and_asks_every_request(unlocked):
    assert answered(unlocked) == dict.fromkeys(ASKED, all_pairs())


def test_behind_the_lock_a_key_passes_only_from_its_writers_to_its_readers(locked):
    may = {
        key: {(one, other) for one, other in all_pairs()
              if key in MAY[one].publishes and key in MAY[other].subscribes}
        for key in SPOKEN
    }  # fmt: skip
    assert heard(locked) == {key: pairs for key, pairs in may.items() if pairs}


def test_behind_the_lock_a_request_passes_only_from_who_may_ask_to_its_server(locked):
    may = {
        key: {(server, client) for server, client in all_pairs()
              if key in MAY[server].serves and key in MAY[client].asks}
        for key in ASKED
    }  # fmt: skip
    assert answered(locked) == {key: pairs for key, pairs in may.items() if pairs}


@pytest.mark.parametrize("wider", ["log/by/**", "*/by/**", "l$*/by/*/*"])
def test_a_wider_key_than_ones_own_hears_what_is_secret_only_where_the_lock_is_open(locked, unlocked, wider):
    def heard_of_others(opened: Sessions) -> list[zenoh.Sample]:
        heard: list[zenoh.Sample] = []
        subscriber = opened["planner"].declare_subscriber(wider, heard.append)
        exchange(opened)
        opened["operator"].put(spoken("log", "operator"), "secret", congestion_control=zenoh.CongestionControl.BLOCK)
        exchange(opened)
        subscriber.undeclare()
        return heard

    assert heard_of_others(unlocked)
    assert not heard_of_others(locked)


def test_a_robot_that_is_not_the_routers_is_nobodys(lock, tmp_path):
    def passes(sections: dict[str, RouterSection], within: float) -> bool:
        with sessions(sections, "parol6") as opened:
            subscriber = opened["viewer"].declare_subscriber("joint_states")
            has_come = until(lambda: opened["gateway"].put("joint_states", "") or subscriber.try_recv(), within)
            return bool(has_come)

    router, open_router = LockedRouter(tmp_path / "locked", lock), RouterProcess(tmp_path / "open")
    roles = ("gateway", "viewer")
    assert passes(dict.fromkeys(roles, open_router.deployment.router), 5.0)
    assert not passes({name: router.section(name) for name in roles}, 0.5)
    router.stop()
    open_router.stop()


KEPT = tuple(topic.key for topic in TOPICS if topic.delivery is not Delivery.LATEST)


def test_what_was_written_before_is_told_by_its_writers_alone_to_its_readers(locked, unlocked):
    """The caches of EVERY and LATCHED keys: a forged one would speak to every late joiner."""

    def cached(opened: Sessions) -> Pairs:
        return answered(opened, KEPT, kept, lambda key, name: read_under(key) + CACHE)

    may = {
        key: {(one, other) for one, other in all_pairs()
              if key in MAY[one].publishes and key in MAY[other].subscribes}
        for key in KEPT
    }  # fmt: skip
    assert cached(unlocked) == dict.fromkeys(KEPT, all_pairs())
    assert cached(locked) == {key: pairs for key, pairs in may.items() if pairs}


def test_the_id_of_a_session_that_is_there_is_not_taken_and_that_of_one_that_was_gives_no_right(lock, tmp_path):
    """Zenoh names sessions by an id that everybody can read and choose."""

    def forges(router: RouterProcess, sections: dict[str, RouterSection]) -> bool:
        roles = ("gateway", "operator")
        with sessions({name: sections[name] for name in roles}) as opened:
            own = str(opened["gateway"].zid())
            with pytest.raises(zenoh.ZError):
                zenoh.open(under(sections["viewer"], own))
            heard: list[str] = []
            reader = opened["operator"].declare_subscriber(
                "joint_states", lambda sample: heard.append(sample.payload.to_string())
            )
            assert until(lambda: opened["gateway"].put("joint_states", "true") or "true" in heard)
            opened["gateway"].close()
            opened["gateway"] = thief = zenoh.open(under(sections["viewer"], own))
            assert str(thief.zid()) == own
            # Its own log passes: where that has come, what was sent before it has come too, or never will.
            logged = opened["operator"].declare_subscriber(read_under("log"), zenoh.handlers.FifoChannel(100))
            both = ("joint_states", spoken("log", "viewer"))
            assert until(lambda: [thief.put(key, "forged") for key in both] and logged.try_recv())
            for each in (reader, logged):
                each.undeclare()
        router.stop()
        return "forged" in heard

    locked, unlocked = LockedRouter(tmp_path / "locked", lock), RouterProcess(tmp_path / "open")
    names = ("gateway", "operator", "viewer")
    assert forges(unlocked, dict.fromkeys(names, unlocked.deployment.router))
    assert not forges(locked, {name: locked.section(name) for name in names})


def under(section: RouterSection, identity: str) -> zenoh.Config:
    config = client_config(section, "rm1")
    config.insert_json5("id", f'"{identity}"')
    return config


def test_parameters_are_set_by_everybody_where_the_lock_is_open_and_behind_it_by_the_operator(locked, unlocked):
    keys = tuple(f"@node/planner/planner/{each}" for each in (*ABOUT, SET))
    assert answered(unlocked, keys) == dict.fromkeys(keys, all_pairs())
    pairs = answered(locked, keys)
    assert {client for server, client in pairs[f"@node/planner/planner/{SET}"]} == {"operator"}
    assert all({server for server, _ in pairs[key]} == {"planner"} for key in keys)
    for each in ABOUT:
        assert {client for _, client in pairs[f"@node/planner/planner/{each}"]} == set(NAMES) - {"planner"}


class Planning(msgspec.Struct, frozen=True, kw_only=True):
    planning_time: float = 5.0


def test_a_viewer_changes_a_running_nodes_parameter_only_where_the_lock_is_open(lock, tmp_path):
    def changed_by(router: RouterProcess, sections: dict[str, RouterSection], who: str) -> bool:
        deployment = Deployment(paths=PathsSection(run=str(tmp_path), out=str(tmp_path)))
        planner = Node("planner", deployment, robot="rm1", bus=ZenohBus(sections["planner"], "rm1"))
        client = ZenohBus(sections[who], "rm1")
        parameters = planner.parameters(Planning)
        with planner, closing(client), spinning(planner), suppress(NoAnswer):
            requests.call(
                client, parameter_request("planner"), SetParameter(name="planning_time", value=0.1), timeout=2.0
            )
        return parameters.value.planning_time == 0.1

    locked, unlocked = LockedRouter(tmp_path / "locked", lock), RouterProcess(tmp_path / "open")
    names = ("planner", "viewer", "operator")
    behind = {name: locked.section(name) for name in names}
    assert changed_by(unlocked, dict.fromkeys(names, unlocked.deployment.router), "viewer")
    assert not changed_by(locked, behind, "viewer")
    assert changed_by(locked, behind, "operator")
    locked.stop()
    unlocked.stop()


def test_a_viewers_flood_reaches_keys_of_others_only_where_the_lock_is_open(lock, tmp_path):
    """What it does behind the lock to an arm that moves: tests/stack/test_hostile_viewer.py."""

    def reached(sections: dict[str, RouterSection]) -> set[str]:
        own = sections["viewer"]
        shown = {"tls": "true", "ca": own.ca, "certificate": own.certificate, "key": own.key} if own.tls else {}
        environ = {f"GEMELO_ROUTER_{name.upper()}": value for name, value in ({"port": str(own.port)} | shown).items()}
        counts: Counter[str] = Counter()
        with sessions({name: sections[name] for name in ("gateway", "planner", "operator")}) as opened:
            declared: list[object] = [
                opened[name].declare_subscriber(read_under(key), lambda sample, key=key: counts.update((key,)))
                for name, key in (("operator", hostile.OWN), ("gateway", FOREIGN[0]), ("operator", FOREIGN[1]))
            ]
            for name, key in zip(("planner", "planner", "gateway"), hostile.ASKED, strict=True):
                wire = served_under(key)
                declared.append(opened[name].declare_queryable(wire, lambda query, key=key: counts.update((key,))))
            flood = subprocess.Popen(
                [sys.executable, "-m", "tests.stack.hostile", "flood"], cwd=ROOT, stdout=subprocess.DEVNULL,
                env=os.environ | environ,
            )  # fmt: skip
            try:
                assert until(lambda: counts[hostile.OWN] > hostile.RATE, 30.0)
            finally:
                flood.kill()
                flood.wait()
            for each in declared:
                each.undeclare()  # type: ignore[attr-defined]
        return set(counts)

    locked, unlocked = LockedRouter(tmp_path / "locked", lock), RouterProcess(tmp_path / "open")
    names = ("gateway", "planner", "operator", "viewer")
    assert reached(dict.fromkeys(names, unlocked.deployment.router)) == {hostile.OWN, *FOREIGN, *hostile.ASKED}
    assert reached({name: locked.section(name) for name in names}) == {hostile.OWN, hostile.ASKED[0]}
    locked.stop()
    unlocked.stop()


def test_a_late_joiner_gets_what_is_latched_behind_the_lock_and_what_it_missed_of_every_message(lock, tmp_path):
    router = LockedRouter(tmp_path, lock)
    gateway, viewer, planner = (ZenohBus(router.section(name), "rm1") for name in ("gateway", "viewer", "planner"))
    arrived: list[tuple[str, bytes]] = []

    def listen(bus: ZenohBus, topic: Topic[Message]) -> None:
        bus.subscribe(
            topic.key, topic.delivery, lambda each: arrived.append((each.writer, each.payload)), lambda n: None
        )

    forged = planner.publish(DEVICE_STATUS.key, "DeviceStatus", Delivery.LATCHED, "stepper_gateway")
    true = gateway.publish(DEVICE_STATUS.key, "DeviceStatus", Delivery.LATCHED, "stepper_gateway")
    forged.put(b"forged")
    true.put(b"true")
    listen(viewer, DEVICE_STATUS)
    assert until(lambda: arrived == [("stepper_gateway", b"true")]), arrived
    listen(viewer, DEVICE_EVENTS)
    events = gateway.publish(DEVICE_EVENTS.key, "DeviceEvent", Delivery.EVERY, "stepper_gateway")
    assert until(lambda: events.put(b"joined") or (arrived[-1][1] == b"joined"))
    router.kill()
    events.put(b"while the router was away")
    router.start()
    assert until(lambda: arrived[-1][1] == b"while the router was away", 60.0), arrived
    assert not any(payload == b"forged" for _, payload in arrived)
    gateway.declare_alive("@alive/gateway/stepper_gateway")
    assert until(lambda: robots_on(router.section("viewer"), "stepper_gateway") == ("rm1",))
    for bus in (gateway, viewer, planner):
        bus.close()
    router.stop()


def test_what_the_issue_says_of_the_roles_is_what_the_tables_give():
    of_a_viewer = MAY["viewer"].publishes | MAY["viewer"].asks
    moving = {"joint_targets", "jog", "plan", "device/command", "scene/edit", "follow_joint_trajectory/goal"}
    assert not of_a_viewer & moving
    assert "plan" not in MAY["viewer"].serves
    control = {"control/take", "control/join", "control/give"}
    assert [name for name in NAMES if MAY[name].asks & control] == ["ros_operator", "panel", "operator", "script"]
    assert MAY["ros_bridge"].asks - {key for key in MAY["ros_bridge"].asks if key.startswith("@node/")} == {
        "device/stop"
    }
    assert [name for name in NAMES if MAY[name].serves & control] == ["gateway"]
    assert [name for name in NAMES if "control" in MAY[name].publishes] == ["gateway"]
    assert not any(f"@request/{key}" in may.subscribes | may.publishes for key in control for may in MAY.values())
    assert not any(key.startswith("device/") for key in MAY["planner"].publishes | MAY["planner"].serves)
    assert [name for name in NAMES if "joint_states" in MAY[name].publishes] == ["gateway"]
    assert all("device/stop" in may.asks for name, may in MAY.items() if name != "gateway")


def test_every_topic_has_a_role_that_writes_it_and_one_that_reads_it():
    for topic in TOPICS:
        assert any(topic.key in may.publishes for may in MAY.values()), topic.key
        assert any(topic.key in may.subscribes for may in MAY.values()), topic.key
