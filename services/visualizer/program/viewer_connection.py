"""The connection to the viewer: detects that a viewer appears, ends, or is replaced.

Rerun's stream does not say when its viewer is gone, and a new viewer knows nothing of the arm. So a plain socket
is kept open to the viewer's port: the kernel closes it the moment the viewer ends.
"""

from __future__ import annotations

import socket
from dataclasses import dataclass, field

CONNECT_TIMEOUT = 0.2  # [s]
RETRY = 1.0  # [s]


@dataclass
class ViewerConnection:
    """Monitors the viewer at host:port."""

    host: str
    port: int
    _socket: socket.socket | None = field(default=None, init=False)
    _retry_at: float = field(default=0.0, init=False)

    @property
    def url(self) -> str:
        """The address for Rerun's SDK."""
        return f"rerun+http://{self.host}:{self.port}/proxy"

    @property
    def is_alive(self) -> bool:
        """True if the viewer found by `is_new` is still connected."""
        if self._socket is None:
            return False
        try:
            if self._socket.recv(4096) == b"":
                self.close()
        except BlockingIOError:
            return True
        except OSError:
            self.close()
        return self._socket is not None

    def is_new(self, now: float) -> bool:
        """Look for a viewer, at most once a second while there is none; `now` on the monotonic clock [s]."""
        if self._socket is not None or now < self._retry_at:
            return False
        self._retry_at = now + RETRY
        try:
            self._socket = socket.create_connection((self.host, self.port), CONNECT_TIMEOUT)
            self._socket.setblocking(False)
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Let go; the next `is_new` looks again."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
