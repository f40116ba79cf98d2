"""An asyncio server of 127.0.0.1 in a thread of its own: what a TCP proxy is made of."""

from __future__ import annotations

import asyncio
import errno
import os
import threading
from asyncio import StreamReader, StreamWriter
from collections.abc import Awaitable, Callable
from contextlib import suppress

PATIENCE = 60.0  # [s] until it listens, or has ended; chosen: a loaded machine


class ProxyThread:
    """Listens on `port`, and has `take` handle each connection in its loop, until `close`; raises OSError where
    nothing can listen there."""

    def __init__(self, port: int, take: Callable[[StreamReader, StreamWriter], Awaitable[None]]) -> None:
        self._port, self._take = port, take
        self._loop = asyncio.new_event_loop()
        self._has_begun, self._is_listening = threading.Event(), False
        self._thread = threading.Thread(target=self._run, name="proxy", daemon=True)
        self._thread.start()
        if not (self._has_begun.wait(PATIENCE) and self._is_listening):
            raise OSError(errno.EADDRNOTAVAIL, os.strerror(errno.EADDRNOTAVAIL), f"127.0.0.1:{port}")

    def call(self, work: Callable[[], object]) -> None:
        """Has the loop do it soon."""
        self._loop.call_soon_threadsafe(work)

    def close(self) -> None:
        """Ends the thread, with every connection."""
        self.call(self._loop.stop)
        self._thread.join(PATIENCE)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            with suppress(OSError):
                server = self._loop.run_until_complete(asyncio.start_server(self._take, "127.0.0.1", self._port))
                self._is_listening = True
                self._has_begun.set()
                self._loop.run_forever()
                server.close()
        finally:
            self._has_begun.set()
        for task in asyncio.all_tasks(self._loop):
            task.cancel()
        self._loop.run_until_complete(asyncio.sleep(0))
        self._loop.close()
