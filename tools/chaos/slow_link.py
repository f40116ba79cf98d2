"""A TCP proxy before the MQTT broker, between gateway and virtual device: cut, stalled, slow, lossy or garbled."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from enum import Enum
from random import Random
from typing import NamedTuple

from gemelo.tools.chaos.lost_packets import PacketLoss
from gemelo.tools.chaos.proxy import ProxyThread

PIECE = 16 * 1024  # [B] that are read at once
LOOK_EVERY = 0.01  # [s] while the link stalls
CONNECT = 0x10  # the first byte of a connection (MQTT 3.1.1 and 5, section 3.1)
VERSION_5 = 5
LONGEST_LENGTH = 4  # [B] of a variable byte integer (section 1.5.5)


class Way(Enum):
    """One direction of a connection."""

    TO_BROKER = "to the broker"
    FROM_BROKER = "from the broker"


class OneWay(NamedTuple):
    """One direction of all connections of the clients whose ids begin with `client`."""

    client: str
    way: Way


class Connection:
    """One client's connection; its id is known from its first packet on."""

    client = ""


class SlowLink:
    """Listens on `port` of 127.0.0.1 and forwards to `target`, in a thread of its own, until `close`.

    `cut`: connections are dropped and none is taken. `stalled`: they stay open, and nothing passes. `delay` [s]: of
    every piece, in both directions. `losing`: the share of MQTT packets of QoS 0 that never arrive. `garbling`: the
    share of pieces of which one byte is changed. `stalled_ways`: as `is_stalled`, in these directions alone.
    """

    def __init__(self, port: int, target: int, seed: int = 0) -> None:
        self.is_cut = False
        self.is_stalled = False
        self.delay = 0.0
        self.losing = 0.0
        self.garbling = 0.0
        self.stalled_ways: frozenset[OneWay] = frozenset()
        self._clients: list[str] = []  # ids, the newest last
        self._target, self._random = target, Random(seed)
        self._writers: set[asyncio.StreamWriter] = set()
        self._thread = ProxyThread(port, self._take)

    def cut(self) -> None:
        """Drops every connection, and takes none until `heal`."""
        self.is_cut = True
        self._thread.call(self._drop_all)

    def heal(self) -> None:
        """Everything passes as it should again."""
        self.is_cut, self.is_stalled, self.delay, self.losing, self.garbling = False, False, 0.0, 0.0, 0.0
        self.stalled_ways = frozenset()

    def newest_client(self, prefix: str) -> str:
        """The MQTT client id that begins with `prefix` and connected last; empty where there was none."""
        return next((client for client in reversed(self._clients) if client.startswith(prefix)), "")

    def close(self) -> None:
        """Drops every connection and ends the thread."""
        self._thread.call(self._drop_all)
        self._thread.close()

    def _drop_all(self) -> None:
        for writer in self._writers:
            writer.transport.abort()

    async def _take(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self.is_cut:
            writer.transport.abort()
            return
        try:
            from_broker, to_broker = await asyncio.open_connection("127.0.0.1", self._target)
        except OSError:
            writer.transport.abort()
            return
        connection = Connection()
        await asyncio.gather(
            self._pump(reader, to_broker, connection, Way.TO_BROKER),
            self._pump(from_broker, writer, connection, Way.FROM_BROKER),
        )

    async def _pump(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, connection: Connection, way: Way
    ) -> None:
        self._writers.add(writer)
        packets = PacketLoss()
        with suppress(OSError):
            while data := await reader.read(PIECE):
                if way is Way.TO_BROKER and not connection.client:
                    self._note(connection, data)
                if self.delay > 0.0:
                    await asyncio.sleep(self.delay)
                while self.is_stalled or self._is_stalled(connection, way):
                    await asyncio.sleep(LOOK_EVERY)
                writer.write(self._garbled(packets.without(data, lambda: self._random.random() < self.losing)))
                await writer.drain()
        self._writers.discard(writer)
        writer.close()

    def _note(self, connection: Connection, first: bytes) -> None:
        connection.client = client_id_in(first)
        if connection.client:
            self._clients.append(connection.client)

    def _is_stalled(self, connection: Connection, way: Way) -> bool:
        return any(each.way is way and connection.client.startswith(each.client) for each in self.stalled_ways)

    def _garbled(self, data: bytes) -> bytes:
        if not data or self._random.random() >= self.garbling:
            return data
        changed = bytearray(data)
        changed[self._random.randrange(len(changed))] ^= 1 << self._random.randrange(8)
        return bytes(changed)


def client_id_in(packet: bytes) -> str:
    """The client id in a CONNECT of MQTT 3.1.1 or 5; empty where the bytes are none, or not a whole one."""
    try:
        return _client_id(packet) if packet[0] == CONNECT else ""
    except (IndexError, UnicodeDecodeError):
        return ""


def _client_id(packet: bytes) -> str:
    _, place = _length(packet, 1)
    protocol, place = _text(packet, place)
    version = packet[place]
    place += 4  # version, flags, keep alive
    if protocol == b"MQTT" and version == VERSION_5:
        size, place = _length(packet, place)
        place += size
    return _text(packet, place)[0].decode()


def _length(packet: bytes, place: int) -> tuple[int, int]:
    """A variable byte integer, and the place after it."""
    value = 0
    for index in range(LONGEST_LENGTH):
        byte = packet[place + index]
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, place + index + 1
    raise IndexError("a length of more than four bytes")


def _text(packet: bytes, place: int) -> tuple[bytes, int]:
    """A text with its length before it, and the place after it."""
    end = place + 2 + int.from_bytes(packet[place : place + 2], "big")
    if end > len(packet):
        raise IndexError("a text that is not whole")
    return packet[place + 2 : end], end
