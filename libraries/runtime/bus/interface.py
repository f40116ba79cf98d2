"""The bus interface: bytes under keys. `ZenohBus` and `MemoryBus` implement it.

Keys are relative to the robot. Callbacks come on threads of the bus: they must only put into a
task queue and return. A bus delivers its own publications only to subscriptions that ask for them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import msgspec

from gemelo.libraries.runtime.clock import Clock
from gemelo.schemas.topics import Delivery

ENCODING = "application/msgpack"  # the schema's name follows after a semicolon

IsFirst = Callable[[bytes], bool]  # of the payload of a request


def never(_payload: bytes) -> bool:
    """No request is before another."""
    return False


class Arrival(msgspec.Struct, frozen=True):
    """One message as it came: `schema` and `writer` (a node's name) are empty where the sender named none.

    Of a key that many nodes write, `writer` is the node's address as the key has it (branches.py), else as it says.
    `instance` is which of the processes with that name, of a LATCHED key: the end of its token (identity.py).
    """

    key: str
    schema: str
    payload: bytes
    writer: str = ""
    instance: str = ""


class BusReply(msgspec.Struct, frozen=True):
    """One reply to a request; `ok` is False where the payload is a `Failure`."""

    ok: bool
    schema: str
    payload: bytes


UNREAD = BusReply(False, "", b"")  # of a request that was dropped, or whose server ended, before its time-out


class Query(Protocol):
    """A request that waits for exactly one of `reply`, `fail` and `drop`, from any thread."""

    @property
    def arrival(self) -> Arrival:
        """Read from the wire when it is first asked for."""
        ...

    @property
    def size(self) -> int:
        """[bytes] of its payload, which need not be read for it."""
        ...

    @property
    def client(self) -> str:
        """The session that asks, by a name that it alone can give; empty where it does not say."""
        ...

    @property
    def principal(self) -> str:
        """Who asks by the certificate, as the router has verified it (branches.py)."""
        ...

    @property
    def number(self) -> int:
        """How many requests its client had asked for with this one; 0 where it does not say."""
        ...

    def reply(self, schema: str, payload: bytes) -> None: ...

    def fail(self, schema: str, payload: bytes) -> None: ...

    def drop(self) -> None:
        """Ends it at once without an answer, which is the cheapest end."""
        ...


class Declaration(Protocol):
    """A declaration at the bus that lasts until it is closed."""

    def close(self) -> None: ...


class Publication(Declaration, Protocol):
    """The right to publish on one key."""

    def put(self, payload: bytes) -> None: ...


class Bus(Protocol):
    """A connection to all other nodes of one robot."""

    @property
    def clock(self) -> Clock:
        """That of everything which uses this bus."""
        ...

    @property
    def is_connected(self) -> bool:
        """True if messages can be sent now; False without a router."""
        ...

    @property
    def router(self) -> str:
        """The router of now, which has another name whenever it was started anew; empty without one."""
        ...

    @property
    def certificate(self) -> str:
        """The file that tells the router the role of this process; empty where it asks for none."""
        ...

    @property
    def common_name(self) -> str:
        """The common name of that certificate; empty without one."""
        ...

    def require_reconnection(self) -> None:
        """Call once a second; raises `BusError` if the router listens but this session stays disconnected."""
        ...

    def publish(self, key: str, schema: str, delivery: Delivery, writer: str = "", instance: str = "") -> Publication:
        """EVERY and LATCHED are kept for readers that miss them while the router is away; `writer` and `instance` go
        with each."""
        ...

    def subscribe(
        self,
        key: str,
        delivery: Delivery,
        on_arrival: Callable[[Arrival], None],
        on_miss: Callable[[int], None],
        own: bool = False,
    ) -> Declaration:
        """`on_miss(n)`: n messages of an EVERY or LATCHED key are lost for good; `own`: hear this bus too.

        Of an EVERY key comes what is written from now on, by the writers' sequence numbers whatever clocks say; of a
        LATCHED one also the last before.
        """
        ...

    def serve(
        self, key: str, on_query: Callable[[Query], None], urgent: bool = False, is_first: IsFirst = never
    ) -> Declaration:
        """Requests under `key` come to `on_query`; of those that wait for it the oldest may be lost if not `urgent`,
        and if it is, those whose payload `is_first` come before the rest."""
        ...

    def wait_served(self, key: str, timeout: float) -> bool:
        """True if a node serves `key`; waits up to `timeout` [s] for it."""
        ...

    def take_number(self) -> int:
        """The number of a request that is asked for now: higher than those of all before it."""
        ...

    def ask(
        self,
        key: str,
        schema: str,
        payload: bytes,
        timeout: float,
        on_answer: Callable[[BusReply | None], None],
        urgent: bool = False,
        number: int = 0,
    ) -> None:
        """Sends one request, before all that waits to be sent if it is `urgent`; else it waits for its turn.

        `on_answer` comes exactly once: with None where no answer came in `timeout` [s], with `UNREAD` at once where
        none will come. `number` is one that `take_number` has given, where it is asked for again.
        """
        ...

    def declare_alive(self, key: str) -> Declaration:
        """A token that vanishes when this process does."""
        ...

    def watch_alive(self, key: str, on_change: Callable[[bool], None]) -> Declaration:
        """`on_change(True)` when the token `key` is there or comes, `on_change(False)` when it vanishes.

        A token with a wildcard in its key is none of them.
        """
        ...

    def watch_tokens(self, pattern: str, on_change: Callable[[str, bool], None]) -> Declaration:
        """As `watch_alive`, for all tokens of `pattern`, where a `*` stands for one chunk: `on_change(key, True)`."""
        ...

    def alive(self, pattern: str) -> set[str]:
        """The keys of the living tokens; a `*` in `pattern` stands for one chunk."""
        ...

    def close(self) -> None:
        """Ends everything declared here; never hangs."""
        ...
