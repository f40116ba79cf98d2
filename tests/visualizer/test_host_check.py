"""The relay in front of the viewer's ports: only this machine's names are answered, and nothing else is changed."""

from __future__ import annotations

import ipaddress
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

from gemelo.libraries.runtime.process.own_names import own_names
from gemelo.libraries.runtime.process.ports import PortTaken
from gemelo.services.visualizer.program.host_check import (
    HTTP2_PREFACE,
    MOST_CONNECTIONS,
    MOST_OF_A_HEAD,
    HostCheck,
    refusal,
    unguessable_host,
)
from gemelo.services.visualizer.program.rerun_program import free_port

LOOPBACK = "127.0.0.1"
LARGE = bytes(range(256)) * 40_000  # 10 MB: more than any buffer on its way
WITHIN = 10.0  # [s]


class Echo:
    """Sends back whatever comes, and counts who came."""

    def __init__(self) -> None:
        self._server = socket.create_server((LOOPBACK, 0))
        self.address: tuple[str, int] = self._server.getsockname()
        self.connections = 0
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        while True:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return
            self.connections += 1
            threading.Thread(target=self._echo, args=(connection,), daemon=True).start()

    def _echo(self, connection: socket.socket) -> None:
        with connection:
            while data := connection.recv(65536):
                connection.sendall(data)

    def close(self) -> None:
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()


@pytest.fixture
def echo() -> Iterator[Echo]:
    echo = Echo()
    yield echo
    echo.close()


@contextmanager
def relayed(echo: Echo, name: str = "") -> Iterator[tuple[str, int]]:
    address = (LOOPBACK, free_port())
    with HostCheck({address: echo.address}, own_names(LOOPBACK, name)):
        yield address


def sent(address: tuple[str, int], data: bytes) -> bytes:
    """All that comes back for `data`, until the other end closes."""
    with socket.create_connection(address, WITHIN) as client:
        feeder = threading.Thread(target=_feed, args=(client, data), daemon=True)
        feeder.start()
        received = b"".join(iter(lambda: client.recv(65536), b""))
        feeder.join(WITHIN)
    return received


def _feed(client: socket.socket, data: bytes) -> None:
    with suppress(OSError):  # it was refused meanwhile
        client.sendall(data)
        client.shutdown(socket.SHUT_WR)


def request(host: str, body: bytes = b"") -> bytes:
    return f"POST /proxy HTTP/1.1\r\nHost: {host}\r\nContent-Length: {len(body)}\r\n\r\n".encode() + body


def test_what_asks_for_this_machine_passes_unchanged_both_ways(echo: Echo) -> None:
    with relayed(echo) as address:
        for host in (f"127.0.0.1:{address[1]}", "localhost", "[::1]:9876", "192.168.1.7"):
            asked = request(host, b"body")
            assert sent(address, asked) == asked
        assert sent(address, request(LOOPBACK, LARGE)) == request(LOOPBACK, LARGE)


def test_a_name_that_a_site_has_pointed_here_is_refused_and_reaches_nothing(echo: Echo) -> None:
    assert sent(echo.address, request("rebound.example:9876")) == request("rebound.example:9876")  # without the check
    with relayed(echo) as address:
        before = echo.connections
        answer = sent(address, request("rebound.example:9876"))
        assert answer.startswith(b"HTTP/1.1 403 Forbidden\r\n")
        assert b'this is not "rebound.example"' in answer
        assert b"[panel] name" in answer
        assert echo.connections == before


def test_the_name_in_the_deployment_is_this_machines(echo: Echo) -> None:
    asked = request("lab-pc.local:9876")
    with relayed(echo) as address:
        assert sent(address, asked).startswith(b"HTTP/1.1 403")
    with relayed(echo, "lab-pc.local") as address:
        assert sent(address, asked) == asked


def test_rerun_s_own_programs_pass_as_they_speak_plain_http_2(echo: Echo) -> None:
    spoken = HTTP2_PREFACE + b"SM\r\n\r\n" + LARGE
    with relayed(echo) as address:
        assert sent(address, spoken) == spoken


@pytest.mark.parametrize(
    "head",
    [
        b"GET / HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: rebound.example\r\nHost: 127.0.0.1\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nhost : rebound.example\r\n\r\n",
        b"GET / HTTP/1.1\r\nHOST: [::1\r\n\r\n",
        b"PRI * HTTP/1.1\r\nHost: rebound.example\r\n\r\n",
        b"\r\n\r\n",
    ],
)
def test_a_request_that_names_no_one_host_of_this_machine_is_refused(head: bytes) -> None:
    assert "this is not" in refusal(head, own_names(LOOPBACK))


def test_a_head_without_an_end_is_cut_off(echo: Echo) -> None:
    with relayed(echo) as address, socket.create_connection(address, WITHIN) as client:
        with suppress(ConnectionError):  # as not all of it was read
            client.sendall(b"GET / HTTP/1.1\r\nX: " + b"x" * (2 * MOST_OF_A_HEAD))
            assert client.recv(1) == b""
        assert echo.connections == 0


def test_a_connection_that_sends_nothing_stays_and_ends_with_the_relay(echo: Echo) -> None:
    """By it the visualizer sees the end of its viewer."""
    with relayed(echo) as address:
        idle = socket.create_connection(address, WITHIN)
        assert sent(address, request(LOOPBACK)) == request(LOOPBACK)
        idle.setblocking(False)
        with pytest.raises(BlockingIOError):
            idle.recv(1)
    idle.settimeout(WITHIN)
    assert idle.recv(1) == b""
    idle.close()


def test_more_connections_than_it_holds_are_closed_and_the_others_go_on(echo: Echo) -> None:
    with relayed(echo) as address:
        idle = [socket.create_connection(address, WITHIN) for _ in range(MOST_CONNECTIONS)]
        with socket.create_connection(address, WITHIN) as one_more:
            assert one_more.recv(1) == b""
        idle[0].sendall(request(LOOPBACK))
        assert idle[0].recv(1024) == request(LOOPBACK)
        for each in idle:
            each.close()


def test_a_port_that_is_taken_is_named() -> None:
    with (
        socket.create_server((LOOPBACK, 0)) as taken,
        pytest.raises(PortTaken, match="cannot listen on 127") as refused,
    ):
        HostCheck({taken.getsockname(): (LOOPBACK, 1)}, frozenset())
    why = refused.value.reason
    assert why.code == "port.viewer"
    assert f"{why.values['port']}" in str(why)


def test_the_program_s_own_address_is_loopback_s_and_another_each_time() -> None:
    hosts = {unguessable_host() for _ in range(100)}
    assert all(ipaddress.ip_address(host).is_loopback for host in hosts)
    assert len(hosts) > 90
