"""A TCP proxy before the MQTT broker, between gateway and virtual device: cut, stalled, slow, lossy or garbled."""

from __future__ import annotations

import asyncio
import threading
from contextlib import suppress
from random import Random

from services.chaos.lost_packets import PacketLoss

PIECE = 16 * 1024  # [B] that are read at once
LOOK_EVERY = 0.01  # [s] while the link stalls


class SlowLink:
    """Listens on `port` of 127.0.0.1 and forwards to `target`, in a thread of its own, until `close`.

    `cut`: connections are dropped and none is taken. `stalled`: they stay open, and nothing passes. `delay` [s]: of
    every piece, in both directions. `losing`: the share of MQTT packets of QoS 0 that never arrive. `garbling`: the
    share of pieces of which one byte is changed.
    """

    def __init__(self, port: int, target: int, seed: int = 0) -> None:
        self.is_cut = False
        self.is_stalled = False
        self.delay = 0.0
        self.losing = 0.0
        self.garbling = 0.0
        self._port, self._target, self._random = port, target, Random(seed)
        self._writers: set[asyncio.StreamWriter] = set()
        self._loop = asyncio.new_event_loop()
        self._is_listening = threading.Event()
        self._thread = threading.Thread(target=self._run, name="slow link", daemon=True)
        self._thread.start()
        if not self._is_listening.wait(5.0):
            raise OSError(f"nothing can listen on 127.0.0.1:{port}")

    def cut(self) -> None:
        """Drops every connection, and takes none until `heal`."""
        self.is_cut = True
        self._loop.call_soon_threadsafe(self._drop_all)

    def heal(self) -> None:
        """Everything passes as it should again."""
        self.is_cut, self.is_stalled, self.delay, self.losing, self.garbling = False, False, 0.0, 0.0, 0.0

    def close(self) -> None:
        """Drops every connection and ends the thread."""
        self._loop.call_soon_threadsafe(self._drop_all)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        with suppress(OSError):
            server = self._loop.run_until_complete(asyncio.start_server(self._take, "127.0.0.1", self._port))
            self._is_listening.set()
            self._loop.run_forever()
            server.close()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0))
        self._loop.close()

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
        await asyncio.gather(self._pump(reader, to_broker), self._pump(from_broker, writer))

    async def _pump(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        packets = PacketLoss()
        with suppress(OSError):
            while data := await reader.read(PIECE):
                if self.delay > 0.0:
                    await asyncio.sleep(self.delay)
                while self.is_stalled:
                    await asyncio.sleep(LOOK_EVERY)
                writer.write(self._garbled(packets.without(data, lambda: self._random.random() < self.losing)))
                await writer.drain()
        self._writers.discard(writer)
        writer.close()

    def _garbled(self, data: bytes) -> bytes:
        if not data or self._random.random() >= self.garbling:
            return data
        changed = bytearray(data)
        changed[self._random.randrange(len(changed))] ^= 1 << self._random.randrange(8)
        return bytes(changed)
