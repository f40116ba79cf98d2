"""A relay in front of the viewer's ports, for the names of this machine alone: Rerun itself does not look at Host.

A web site may point a name of its own at this machine (DNS rebinding), and its page may then read what the viewer's
ports answer. The first request of a connection is checked, as a browser uses each for one name; gRPC over plain HTTP/2,
as Rerun's own programs speak it, passes: no browser does. A connection that sends nothing stays open.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
import sys
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from functools import partial
from types import TracebackType
from typing import Self

from gemelo.libraries.runtime.process.own_names import host_objection
from gemelo.libraries.runtime.process.ports import PortTaken
from gemelo.schemas.reasons import because

Address = tuple[str, int]

HTTP2_PREFACE = b"PRI * HTTP/2.0\r\n\r\n"  # RFC 9113, section 3.4, up to its first empty line
END_OF_HEAD = b"\r\n\r\n"
MOST_OF_A_HEAD = 64 * 1024  # [bytes] of a request before its body; chosen: browsers send a few thousand
AT_ONCE = 256 * 1024  # [bytes] passed on together; chosen: a picture of a camera
MOST_CONNECTIONS = 256  # at a time, on all ports; chosen: a page has some ten
PATIENCE = 2.0  # [s] until the thread has ended


class HostCheck:
    """Passes on what comes to some ports, in a thread of its own, from entering to leaving the context."""

    def __init__(self, ports: Mapping[Address, Address], names: frozenset[str]) -> None:
        """What comes to each key goes to its value, if it asks for one of `names` or for an address. Raises `PortTaken`
        where a key cannot be listened on."""
        self._names = names
        self._listening = list[tuple[socket.socket, Address]]()
        with ExitStack() as undone:
            for address, to in ports.items():
                self._listening.append((undone.enter_context(_listening(address)), to))
            undone.pop_all()
        self._servers = list[asyncio.Server]()
        self._connections = 0
        self._loop = asyncio.new_event_loop()
        self._is_over = asyncio.Event()
        self._thread = threading.Thread(target=self._run, daemon=True, name="host check")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._loop.call_soon_threadsafe(self._is_over.set)
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:  # ends what is still open
            runner.run(self._serve())

    async def _serve(self) -> None:
        for listening, to in self._listening:
            take = partial(self._on_connection, to)
            self._servers.append(await asyncio.start_server(take, sock=listening, limit=MOST_OF_A_HEAD))
        await self._is_over.wait()
        for server in self._servers:
            server.close()

    async def _on_connection(self, to: Address, reader: StreamReader, writer: StreamWriter) -> None:
        self._connections += 1
        try:
            if self._connections <= MOST_CONNECTIONS:
                with suppress(OSError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
                    await self._check(to, reader, writer)
        finally:
            self._connections -= 1
            writer.close()

    async def _check(self, to: Address, reader: StreamReader, writer: StreamWriter) -> None:
        head = await reader.readuntil(END_OF_HEAD)
        if reason := refusal(head, self._names):
            writer.write(_forbidden(reason))
            return await writer.drain()
        answers, upstream = await asyncio.open_connection(*to)
        try:
            upstream.write(head)
            async with asyncio.TaskGroup() as both:
                both.create_task(_pass_on(reader, upstream))
                both.create_task(_pass_on(answers, writer))
        except* OSError:  # either end has gone
            pass
        finally:
            upstream.close()


def refusal(head: bytes, names: frozenset[str]) -> str:
    """Why a connection that begins with `head` is refused, empty if it is not."""
    if head == HTTP2_PREFACE:
        return ""
    fields = [line.partition(":") for line in head.decode("latin-1").split("\r\n")[1:]]
    hosts = [value.strip() for name, _, value in fields if name.strip().lower() == "host"]
    return host_objection(hosts[0] if len(hosts) == 1 else None, names)


def unguessable_host() -> str:
    """An address that only this machine reaches; on Linux, which has all of 127.0.0.0/8, none that a page can guess."""
    if sys.platform != "linux":
        return "127.0.0.1"
    return f"127.{1 + secrets.randbelow(254)}.{secrets.randbelow(256)}.{1 + secrets.randbelow(254)}"


async def _pass_on(reader: StreamReader, writer: StreamWriter) -> None:
    while data := await reader.read(AT_ONCE):
        writer.write(data)
        await writer.drain()
    writer.write_eof()


def _listening(address: Address) -> socket.socket:
    host, port = address
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    is_dual = host == "::" and socket.has_dualstack_ipv6()
    try:
        return socket.create_server(address, family=family, dualstack_ipv6=is_dual)
    except OSError as error:
        raise PortTaken(because("port.viewer", host=host, port=port, error=str(error))) from None


def _forbidden(reason: str) -> bytes:
    body = f"{reason}\n".encode()
    fields = f"Content-Type: text/plain; charset=utf-8\r\nContent-Length: {len(body)}\r\nConnection: close"
    return f"HTTP/1.1 403 Forbidden\r\n{fields}\r\n\r\n".encode() + body
