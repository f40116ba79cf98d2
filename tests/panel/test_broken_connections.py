"""Garbage sent to the page's port: no traceback, one counted line, and the page goes on; no stack is needed for it."""

from __future__ import annotations

import contextlib
import os
import socket
import ssl
import struct
from collections.abc import Callable, Iterator, Mapping

import msgspec
import pytest
import viser
from websockets.sync.client import ClientConnection, connect

from gemelo.services.panel.view.broken_connections import PAGE, PERIOD, BrokenConnections
from gemelo.services.panel.view.own_pages import OwnServer, own_pages_only
from tests.panel.person import until

UPGRADE = "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
KEY = "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"


def hello() -> bytes:
    """The first bytes of a TLS client."""
    sent = ssl.MemoryBIO()
    client = ssl.create_default_context().wrap_bio(ssl.MemoryBIO(), sent, server_hostname="panel")
    with contextlib.suppress(ssl.SSLWantReadError):
        client.do_handshake()
    return sent.read()


RAW: Mapping[str, bytes] = {
    "nothing": b"",
    "garbage": os.urandom(3000),
    "lines of garbage": b"\x1b]52;c;AAAA\x07\r\n" * 200,
    "a TLS hello": hello(),
    "half a request": b"GET / HTTP/1.1\r\nHost: 127",
    "another method": b"POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 5\r\n\r\nhello",
    "another protocol": b"SSH-2.0-OpenSSH_9.6\r\n",
    "a header too long": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nA: " + b"a" * 200_000 + b"\r\n\r\n",
    "headers too many": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + b"A: a\r\n" * 2000 + b"\r\n",
    "an upgrade without a key": (UPGRADE + "\r\n").encode(),
    "an upgrade with a short key": (UPGRADE + "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: a\r\n\r\n").encode(),
    "no version of the page": (UPGRADE + KEY + "\r\n").encode(),
    "an old version": (UPGRADE + KEY + "Sec-WebSocket-Protocol: viser-v0.0.1\r\n\r\n").encode(),
    "frames of garbage": (UPGRADE + KEY + f"Sec-WebSocket-Protocol: {PAGE}\r\n\r\n").encode() + os.urandom(3000),
}


def packed(**fields: object) -> bytes:
    """A message as a browser sends it."""
    return msgspec.msgpack.encode(fields)


MESSAGES: Mapping[str, str | bytes] = {
    "a text": "hello",
    "bytes": b"\xc1\xff\x00",
    "no map": msgspec.msgpack.encode([1, 2]),
    "no type": packed(a=1),
    "an unknown type": packed(type="NoSuchMessage"),
    "a type that is a number": packed(type=7),
    "fields that are missing": packed(type="GuiUpdateMessage"),
    "fields of other types": packed(type="GuiUpdateMessage", uuid=7, updates=7),
    "a control that is none": packed(type="GuiUpdateMessage", uuid="none", updates={"value": 1}),
    "a picture of nothing": packed(type="GetRenderResponseMessage", payload="a", render_uuid=7),
    "a file without a beginning": packed(
        type="FileTransferPart", transfer_uuid="a", part=0, content=b"", source_component_uuid=None
    ),
}


def send_raw(port: int, sent: bytes, leaves_hard: bool) -> None:
    """Sends bytes and closes; `leaves_hard` without a word, as a client that is killed."""
    with socket.create_connection(("127.0.0.1", port), timeout=20.0) as client, contextlib.suppress(OSError):
        client.sendall(sent)
        if leaves_hard:
            client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return
        client.shutdown(socket.SHUT_WR)
        while client.recv(65536):
            pass


def browser(port: int) -> ClientConnection:
    """One that has loaded the page."""
    return connect(f"ws://127.0.0.1:{port}", subprotocols=[PAGE], max_size=None)  # type: ignore[list-item]


def one_round(port: int) -> None:
    """Everything once."""
    for sent in RAW.values():
        for leaves_hard in (False, True):
            send_raw(port, sent, leaves_hard)
    for message in MESSAGES.values():
        with browser(port) as page:
            page.recv(timeout=20.0)
            page.send(message)  # it is read before the closing that follows


@pytest.fixture
def serve() -> Iterator[Callable[[BrokenConnections | None], int]]:
    """The port of a server: with our lock, or viser's own where there is None."""
    servers: list[viser.ViserServer] = []

    def served(broken: BrokenConnections | None) -> int:
        if broken is None:
            servers.append(viser.ViserServer("127.0.0.1", 0, verbose=False))
        else:
            with own_pages_only("127.0.0.1", broken):
                servers.append(OwnServer("127.0.0.1", 0, verbose=False))
        return servers[-1].get_port()

    yield served
    for server in servers:
        server.stop()


def test_without_our_lock_a_round_of_garbage_is_a_round_of_tracebacks(serve, capfd, caplog):
    one_round(serve(None))
    shown: list[str] = []

    def tracebacks() -> int:
        shown.extend(capfd.readouterr())
        return ("".join(shown) + caplog.text).count("Traceback")

    until(tracebacks, lambda count: count > 10)


def test_a_round_of_garbage_is_one_line_and_the_page_goes_on(serve, capfd, caplog):
    said: list[str] = []
    broken = BrokenConnections(said.append)
    port = serve(broken)
    capfd.readouterr()
    with browser(port) as person:
        person.recv(timeout=20.0)
        one_round(port)
        broken.report(1000.0)
        one_round(port)
        broken.report(1000.0 + 0.9 * PERIOD)
        assert len(said) == 1
        assert "what was sent to the page's port was no browser's, and was refused " in said[0]
        assert "\x1b" not in said[0]
        broken.report(1000.0 + PERIOD)
        assert len(said) == 2
        assert person.ping().wait(20.0)
    with browser(port) as another:
        assert another.recv(timeout=20.0)
    shown = capfd.readouterr()
    assert "Traceback" not in shown.err + shown.out + caplog.text
    assert shown.out == ""
    broken.report(1000.0 + 3 * PERIOD)
    quiet = len(said)
    broken.report(1000.0 + 9 * PERIOD)
    assert len(said) == quiet


def test_a_fault_of_the_page_itself_is_said_with_its_place():
    said: list[str] = []
    broken = BrokenConnections(said.append)
    try:
        raise KeyError("a\x1b]52;c;AAAA\x07")
    except KeyError as error:
        broken.note("a message", error)
    broken.report(0.0)
    assert "refused once; last: a message: KeyError: 'a\\x1b]52;c;AAAA\\x07' (test_a_fault_of_the_page" in said[0]
