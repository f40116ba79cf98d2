"""A session whose link to the router lives, and which the router does not know any more, does not go on for ever."""

from __future__ import annotations

import asyncio
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gemelo.libraries.runtime.bus import zenoh_bus
from gemelo.libraries.runtime.bus.recognition import Recognition
from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import DeviceCommandResponse
from gemelo.schemas.topics import DEVICE_STOP
from gemelo.tools.chaos.proxy import ProxyThread
from gemelo.tools.stack.stack import free_ports
from tests.runtime.support import RouterProcess, until

LENGTH = struct.Struct("<H")  # before every batch of Zenoh over TCP
KEEP_ALIVE = 1  # [B] of a batch that says no more than that its sender lives
SOON = 1.5  # [s] in place of RECONNECTION_TIMEOUT


class ForgettingRouter:
    """A way to the router on which, once it `forgets`, nothing but the signs of life of both ends passes."""

    def __init__(self, target: int) -> None:
        (self.port,) = free_ports(1)
        self.forgets = False
        self._target = target
        self._thread = ProxyThread(self.port, self._take)

    def close(self) -> None:
        self._thread.close()

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        from_router, to_router = await asyncio.open_connection("127.0.0.1", self._target)
        await asyncio.gather(self._pump(reader, to_router), self._pump(from_router, writer))

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with suppress(OSError, asyncio.IncompleteReadError):
            while True:
                head = await reader.readexactly(LENGTH.size)
                batch = await reader.readexactly(*LENGTH.unpack(head))
                if not self.forgets or len(batch) <= KEEP_ALIVE:
                    writer.write(head + batch)
                    await writer.drain()
        writer.close()


class Watched(Recognition):
    """As the bus makes it, to be looked at."""

    newest: Recognition

    def __init__(self, longest: float) -> None:
        super().__init__(longest)
        Watched.newest = self


def is_known() -> bool:
    """True once the router has answered for the node's session."""
    return Watched.newest.is_certain


@pytest.fixture
def way(own_router: RouterProcess, monkeypatch: pytest.MonkeyPatch) -> Iterator[ForgettingRouter]:
    monkeypatch.setattr(zenoh_bus, "Recognition", Watched)
    monkeypatch.setattr(zenoh_bus, "RECONNECTION_TIMEOUT", SOON)
    way = ForgettingRouter(own_router.port)
    yield way
    way.close()


@pytest.fixture
def own_router(tmp_path: Path) -> Iterator[RouterProcess]:
    process = RouterProcess(tmp_path)
    yield process
    process.kill()


@pytest.fixture
def node(own_router: RouterProcess, way: ForgettingRouter) -> Iterator[Node]:
    deployment = replace(own_router.deployment, router=replace(own_router.deployment.router, port=way.port))
    with Node("stepper_gateway", deployment, robot="rm1") as node:
        node.serve(DEVICE_STOP, lambda request: DeviceCommandResponse(accepted=True))
        yield node


class Spins:
    """The node spins in a thread of its own; `error` is what has ended it."""

    def __init__(self, node: Node) -> None:
        self.error: BaseException | None = None
        self._node = node
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Spins:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._node.stop()
        self._thread.join(60.0)

    def _run(self) -> None:
        try:
            self._node.spin()
        except BaseException as error:
            self.error = error


@pytest.mark.full
def test_a_node_whose_session_the_router_has_forgotten_ends_with_a_sentence(way: ForgettingRouter, node: Node) -> None:
    with Spins(node) as spins:
        assert until(is_known, 60.0)
        way.forgets = True
        assert until(lambda: spins.error is not None, 60.0)
    assert isinstance(spins.error, BusError)
    assert "has not known this session for 1.5 s" in str(spins.error)


@pytest.mark.full
def test_a_node_that_the_router_knows_goes_on_for_longer_than_it_may_be_forgotten(
    way: ForgettingRouter, node: Node
) -> None:
    with Spins(node) as spins:
        assert until(is_known, 60.0)
        assert not until(lambda: spins.error is not None, 2.5 * SOON)
        assert node.is_connected


class Answering:
    """A session whose router gives so many answers to each question."""

    def __init__(self, *counts: int) -> None:
        self._counts = list(counts)

    def liveliness(self) -> Answering:
        return self

    def get(self, token: str, callback: Any, timeout: float) -> None:
        answer = type("Reply", (), {"ok": object()})
        for _ in range(self._counts.pop(0)):
            callback.callback(answer)
        callback.drop()


def test_a_router_that_has_never_answered_otherwise_is_not_concluded_from() -> None:
    recognition, session = Recognition(longest=0.0), Answering(1, 1, 2, 1)
    for expected in ("", "", ""):
        recognition.ask(session, "token")  # type: ignore[arg-type]
        assert recognition.complaint(1e12, is_served=True) == expected
    recognition.ask(session, "token")  # type: ignore[arg-type]
    assert "has not known this session" in recognition.complaint(1e12, is_served=True)
    recognition.begin_anew()
    assert recognition.complaint(1e12, is_served=True) == ""


def test_a_session_for_stops_that_the_router_has_dropped_is_seen_once_it_was_there() -> None:
    recognition = Recognition(longest=10.0)
    assert [recognition.complaint(now, is_served=False) for now in (0.0, 100.0)] == ["", ""]
    assert recognition.complaint(101.0, is_served=True) == ""
    assert [recognition.complaint(now, is_served=False) for now in (102.0, 111.0)] == ["", ""]
    assert "has not known the session for stops for 10 s" in recognition.complaint(113.0, is_served=False)
    recognition.begin_anew()
    assert recognition.complaint(114.0, is_served=False) == ""
