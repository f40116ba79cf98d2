"""Each browser is sent no more than it reads: one that stops reading sees the present when it goes on, not the past.

A connection takes megabytes that nobody reads, which are minutes of an arm that moves. viser replaces what it has not
sent yet by what is newer, so it is enough to send nothing to a browser that is behind.
"""

from __future__ import annotations

from asyncio import Future, ensure_future
from collections import deque
from collections.abc import AsyncIterable, Iterable
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.typing import Data

UNREAD = 4  # messages under way at most, chosen: those of 0.16 s while the arm moves, a round trip of a slow network


class PacedConnection(ServerConnection):
    """Asks with a ping behind each message whether it was read: a browser answers in the order in which it reads."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._unread: deque[Future[float]] = deque()  # the answers that are missing, the oldest first

    async def send(self, message: Data | Iterable[Data] | AsyncIterable[Data], text: bool | None = None) -> None:
        """Returns when there is room for the next message: viser then makes that of what is newest.

        Raises ConnectionClosed where the browser goes meanwhile.
        """
        await super().send(message, text)
        self._unread.append(ensure_future(await self.ping()))
        while len(self._unread) >= UNREAD:
            await self._unread[0]
            while self._unread and self._unread[0].done():
                self._unread.popleft()
