"""The proxy before the broker: what passes, and what does not."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import closing

import pytest
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.tools.chaos.slow_link import OneWay, SlowLink, Way, client_id_in
from gemelo.tools.stack.stack import free_ports
from tests.broker.running import VERSIONS

SHORTLY = 0.3  # [s] in which an echo would be back many times


def echo(server: socket.socket) -> None:
    while True:
        try:
            connection, _ = server.accept()
        except OSError:
            return
        threading.Thread(target=lambda peer=connection: _echo_to(peer), daemon=True).start()


def _echo_to(peer: socket.socket) -> None:
    with closing(peer):
        while data := peer.recv(4096):
            peer.sendall(data)


@pytest.fixture
def link() -> Iterator[SlowLink]:
    port, target = free_ports(2)
    with socket.create_server(("127.0.0.1", target)) as server:
        threading.Thread(target=echo, args=(server,), daemon=True).start()
        proxy = SlowLink(port, target)
        proxy.port = port  # type: ignore[attr-defined]
        yield proxy
        proxy.close()


def client(link: SlowLink) -> socket.socket:
    return socket.create_connection(("127.0.0.1", link.port), timeout=5.0)  # type: ignore[attr-defined]


def is_dropped(peer: socket.socket) -> bool:
    try:
        return peer.recv(100) == b""
    except ConnectionResetError:
        return True


def assert_comes_when_healed(data: bytes, peer: socket.socket, link: SlowLink) -> None:
    peer.settimeout(SHORTLY)
    with pytest.raises(TimeoutError):
        peer.recv(100)
    link.heal()
    peer.settimeout(5.0)
    assert peer.recv(100) == data


def test_everything_passes_both_ways(link: SlowLink) -> None:
    with client(link) as peer:
        peer.sendall(b"there")
        assert peer.recv(100) == b"there"


def test_a_cut_drops_what_is_connected_and_takes_nobody_until_it_is_healed(link: SlowLink) -> None:
    with client(link) as peer:
        peer.sendall(b"1")
        assert peer.recv(100) == b"1"
        link.cut()
        assert is_dropped(peer)
    try:
        with client(link) as peer:
            assert is_dropped(peer)
    except OSError:
        pass  # dropped while it was connecting
    link.heal()
    with client(link) as peer:
        peer.sendall(b"3")
        assert peer.recv(100) == b"3"


def test_a_stall_keeps_what_is_said_until_it_is_healed(link: SlowLink) -> None:
    with client(link) as peer:
        link.is_stalled = True
        peer.sendall(b"late")
        assert_comes_when_healed(b"late", peer, link)


def connect_of(version: str, client_id: str) -> bytes:
    """What paho sends first."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        client = Client(CallbackAPIVersion.VERSION2, client_id=client_id, protocol=VERSIONS[version])
        client.connect_async("127.0.0.1", server.getsockname()[1])
        client.loop_start()
        peer, _ = server.accept()
        with peer:
            packet = peer.recv(4096)
        client.disconnect()
        stop_loop(client)
    return packet


@pytest.mark.parametrize("version", VERSIONS)
def test_the_id_of_a_client_is_read_in_its_first_packet_alone(version: str) -> None:
    packet = connect_of(version, "gemelo-device-rm1-0a1b")
    assert client_id_in(packet) == "gemelo-device-rm1-0a1b"
    assert [client_id_in(piece) for piece in (b"", packet[:9], packet[:-30], b"\x30" + packet[1:])] == [""] * 4


def test_a_way_that_stalls_keeps_what_goes_that_way_of_that_client_alone(link: SlowLink) -> None:
    device, gateway = connect_of("5", "gemelo-device-rm1-0a1b"), connect_of("5", "gemelo-gateway-0a1b")
    with client(link) as one, client(link) as other:
        for peer, first in ((one, device), (other, gateway)):
            peer.settimeout(5.0)
            peer.sendall(first)
            assert peer.recv(4096) == first
        assert link.newest_client("gemelo-device-") == "gemelo-device-rm1-0a1b"
        assert link.newest_client("nobody-") == ""
        link.stalled_ways = frozenset({OneWay("gemelo-device-", Way.FROM_BROKER)})
        for peer in (one, other):
            peer.sendall(b"there")
        assert other.recv(100) == b"there"
        assert_comes_when_healed(b"there", one, link)


def test_garbling_changes_one_bit_of_a_piece(link: SlowLink) -> None:
    link.garbling = 1.0
    with client(link) as peer:
        peer.sendall(bytes(100))
        seen = peer.recv(100)
    assert len(seen) == 100
    assert sum(byte.bit_count() for byte in seen) in (0, 2)  # there and back: two bits, or the same one twice
