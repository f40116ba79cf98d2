"""A client of ROS 2 on plain Zenoh, which asks exactly as rmw_zenoh_cpp does, and a router as rmw_zenohd is one."""

from __future__ import annotations

import itertools
import json
import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import zenoh
import zenoh.ext as zx
from zenoh.handlers import Callback

from gemelo.libraries.ros2.types import decode, encode, make, ros_type
from gemelo.libraries.runtime.ros_wire.names import Attachment, RosType, read_attachment
from tests.runtime.support import free_port, until

EMPTY = {"structure_needs_at_least_one_member": 0}
SETTINGS = {
    "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
    "timestamping": {"enabled": True},
}


@contextmanager
def ros_router(port: int = 0) -> Iterator[str]:
    """The locator of a router on loopback in this process."""
    locator = f"tcp/127.0.0.1:{port or free_port()}"
    config = SETTINGS | {"mode": "router", "listen": {"endpoints": [locator]}}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(config))):
        yield locator


class Heard(NamedTuple):
    """A message, and what came with it."""

    message: Any
    attachment: Attachment


class Asked:
    """A question that was sent."""

    def __init__(self, kind: str, attachment: Attachment) -> None:
        self._kind, self.attachment = kind, attachment
        self.replies: list[zenoh.Reply] = []
        self.is_over = False

    def end(self) -> None:
        self.is_over = True

    def response(self) -> Any:
        """The one reply, decoded; its attachment repeats the request's number and GID."""
        assert len(self.replies) == 1, [str(each.err) for each in self.replies]
        sample = self.replies[0].ok
        assert sample is not None
        answered = read_attachment(bytes(sample.attachment or b""))
        assert answered is not None
        assert (answered.sequence, answered.gid) == (self.attachment.sequence, self.attachment.gid)
        return decode(f"{self._kind}_Response", bytes(sample.payload))


class RosClient:
    """Topics, services and tokens of a domain."""

    def __init__(self, locator: str, domain: int = 0) -> None:
        config = SETTINGS | {"mode": "client", "connect": {"endpoints": [locator]}}
        self.session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self._domain, self._numbers = domain, itertools.count(1)
        self._kept: list[Any] = []

    def __enter__(self) -> RosClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.session.close()

    def key(self, name: str, kind: RosType) -> str:
        return f"{self._domain}/{name.strip('/')}/{kind.on_wire}/{kind.hash}"

    def tokens(self, pattern: str = "**") -> list[str]:
        """All tokens of ROS on the domain, sorted."""
        replies = self.session.liveliness().get(f"@ros2_lv/{self._domain}/{pattern}", timeout=5.0)
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)

    def subscribe(self, name: str, kind: str, latched: bool = False, type_: RosType | None = None) -> list[Heard]:
        """What comes from now on, and before it what is latched."""
        wanted = type_ or ros_type(kind)
        heard: list[Heard] = []

        def on_sample(sample: zenoh.Sample) -> None:
            attachment = read_attachment(bytes(sample.attachment or b""))
            assert attachment is not None  # a node of rmw_zenoh_cpp drops a message without one
            message = decode(kind, bytes(sample.payload)) if type_ is None else bytes(sample.payload)
            heard.append(Heard(message, attachment))

        key = self.key(name, wanted)
        if latched:
            history = zx.HistoryConfig(detect_late_publishers=True)
            recovery = zx.RecoveryConfig(periodic_queries=None, heartbeat=True)
            self._kept.append(zx.declare_advanced_subscriber(self.session, key, on_sample, history=history,
                                                             recovery=recovery))  # fmt: skip
        else:
            self._kept.append(self.session.declare_subscriber(key, on_sample))
        return heard

    def call(self, name: str, kind: str, **fields: Any) -> Any:
        """The decoded response; `kind` of the service, whose request has these fields."""
        return self.ask(name, kind, encode(make(f"{kind}_Request", **(fields or EMPTY))))

    def ask(self, name: str, kind: str, request: bytes) -> Any:
        """As `call`, of a request in bytes."""
        asked = self.send(name, kind, request)
        assert until(lambda: asked.is_over)
        return asked.response()

    def begin(self, name: str, kind: str, gid: bytes = b"", **fields: Any) -> Asked:
        """As `call`, and waits for nothing."""
        return self.send(name, kind, encode(make(f"{kind}_Request", **(fields or EMPTY))), gid)

    def send(self, name: str, kind: str, request: bytes, gid: bytes = b"", timeout: float = 120.0) -> Asked:
        """As `begin`, of a request in bytes; `timeout` in [s]."""
        asked = Asked(kind, Attachment(next(self._numbers), time.time_ns(), gid or secrets.token_bytes(16)))
        self.session.get(
            self.key(name, ros_type(kind)), Callback(asked.replies.append, asked.end, indirect=False),
            payload=request, attachment=asked.attachment.packed(), timeout=timeout,
            target=zenoh.QueryTarget.ALL_COMPLETE, consolidation=zenoh.ConsolidationMode.NONE,
        )  # fmt: skip
        return asked

    def publish(self, name: str, message: Any) -> None:
        """One message on a topic, as a publisher of ROS sends it."""
        attachment = Attachment(next(self._numbers), time.time_ns(), secrets.token_bytes(16))
        key = self.key(name, ros_type(message.__msgtype__))
        self.session.put(key, encode(message), attachment=attachment.packed())

    def declare_client(self, token: str) -> Any:
        """The token of a service client, to be undeclared."""
        return self.session.liveliness().declare_token(token)


def comes(heard: list[Heard], count: int = 1) -> Any:
    """The message number `count`, which is waited for."""
    assert until(lambda: len(heard) >= count), f"{len(heard)} of {count} messages"
    return heard[count - 1].message
