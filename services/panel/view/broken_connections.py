"""Connections to the page's port that are no browser's: each is closed, and one line a minute at most counts them."""

from __future__ import annotations

import asyncio
import logging
import threading
import traceback
from collections.abc import Awaitable, Callable
from typing import Any

import viser
from websockets.asyncio.server import ServerConnection
from websockets.frames import CloseCode

from gemelo.schemas.plain_text import escaped

PERIOD = 60.0  # [s] from one line to the next
LONGEST = 200  # letters of what is said of one
PAGE = f"viser-v{viser.__version__}"  # the subprotocol of a browser that has loaded this page
Handler = Callable[[ServerConnection], Awaitable[None]]


class BrokenConnections(logging.Handler):
    """Counts what the page's server would have said of each with a traceback; any thread may note one."""

    def __init__(self, say: Callable[[str], None]) -> None:
        super().__init__(logging.WARNING)
        self._say, self._guard = say, threading.Lock()
        self._count, self._newest, self._said_at = 0, "", -PERIOD  # [s] monotonic
        self.logger = logging.Logger("page's server", logging.WARNING)  # for websockets
        self.logger.addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Notes an error of the server."""
        self.note(record.getMessage(), record.exc_info[1] if record.exc_info else None)

    def note(self, what: str, error: BaseException | None) -> None:
        """One more, and why."""
        with self._guard:
            self._count += 1
            self._newest = escaped(f"{what}{_of(error)}").replace("\n", " ")[:LONGEST]

    def report(self, now: float) -> None:
        """Says how many there were, if there were any and the last line was long enough ago; `now` [s] monotonic."""
        with self._guard:
            if not self._count or now - self._said_at < PERIOD:
                return
            count, self._count, self._said_at = self._count, 0, now
        times = "once" if count == 1 else f"{count} times"
        self._say(f"what was sent to the page's port was no browser's, and was refused {times}; last: {self._newest}")

    def guarded(self, handler: Handler) -> Handler:
        """The handler of a connection that gives up what is not the page's, without a traceback."""

        async def handle(connection: ServerConnection) -> None:
            if connection.subprotocol != PAGE:
                self.note(f"a page of {connection.subprotocol or 'no version'}, not of {PAGE}: load it again", None)
                # What viser says to a page of another version, which shows it.
                reason = f"Version mismatch. Client: {connection.subprotocol}, Server: {viser.__version__}"
                await connection.close(CloseCode.PROTOCOL_ERROR, reason[:120])
                return
            try:
                await handler(connection)
            except Exception as error:
                self.note("a message that is none of the page's", error)
                await connection.close(CloseCode.INVALID_DATA)

        return handle

    def on_lost_exception(self, loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        """Notes what no task of the server's loop has awaited."""
        self.note(str(context.get("message", "")), context.get("exception"))


def _of(error: BaseException | None) -> str:
    """The error with its innermost line: it may be a fault of the page's, not of who connects."""
    if error is None:
        return ""
    frames = traceback.extract_tb(error.__traceback__)
    where = f" ({frames[-1].name}, line {frames[-1].lineno})" if frames else ""
    return f": {type(error).__name__}: {error}{where}"
