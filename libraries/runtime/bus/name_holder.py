"""One node for each name: of two that live with one name the older gives way.

A second node does not start while the first lives (`identity.claim`). But a process that was stopped for longer than
its lease loses its token, another is started in its place, and then it goes on: it is the older one, and it ends.
"""

from __future__ import annotations

from collections.abc import Callable

from gemelo.libraries.runtime.bus.identity import Identity, instance_of, is_token

# A second node that starts declares its token for a moment before it sees the first one.
STAYS = 1.0  # [s] that a newer token must live; chosen: five times the longest such moment
STOPPED = 0.9  # [s] between two turns of a loop, after which its process was stopped; chosen: below the lease of 1 s
BACK = 0.6  # [s] connected to the router, after which it has said who else lives; chosen: longer than its retry
AGAIN = 1.0  # [s] after a stop until the name is certain; chosen: a session notices by then that it was closed


class NameHolder:
    """Whether this node may go on under its name; times in [s] monotonic."""

    def __init__(self, identity: Identity) -> None:
        self._identity = identity
        self._newer: dict[str, float] = {}  # since when, by the key of the token

    def on_token(self, key: str, is_there: bool, now: float) -> None:
        """A token of this name has come or gone at `now` [s] monotonic."""
        if not is_there:
            self._newer.pop(key, None)
        elif is_token(key) and key > self._identity.key:
            self._newer.setdefault(key, now)

    @property
    def newer(self) -> str:
        """The token of a node that has started after this one, under its name; empty if there is none."""
        return max(self._newer) if self._newer else ""

    def objection(self, now: float) -> str:
        """Why this node has to end at `now` [s] monotonic, empty if it may go on."""
        lasting = [key for key, since in self._newer.items() if now - since > STAYS]
        return taken_over(self._identity.name, max(lasting)) if lasting else ""


def taken_over(name: str, key: str) -> str:
    """The sentence for a node whose name has gone to that with the token `key`."""
    pid, host = instance_of(key)
    return (
        f'another node named "{name}" has started since this one (process {pid} on {host}): this one, which was '
        "stopped or cut off meanwhile, ends"
    )


class StopWatch:
    """Notices that the process was stopped, and is not certain of its name for a while then."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._certain_from: float | None = None  # [s] monotonic, at the earliest; None while nothing is in doubt
        self._connected_since: float | None = None

    def is_certain(self, now: float, is_connected: Callable[[], bool], newer: Callable[[], str]) -> bool:
        """True if the name is this node's; ask at every turn of its loop, at `now` [s] monotonic, before all else.

        `newer` gives the token of a node that has started since under the same name; it is asked where there is doubt.
        """
        gap = 0.0 if self._last is None else now - self._last
        self._last = now
        if gap > STOPPED:
            self._certain_from, self._connected_since = now + AGAIN, None
        if self._certain_from is None:
            return True
        self._connected_since = (self._connected_since or now) if is_connected() else None
        is_back = self._connected_since is not None and now - self._connected_since >= BACK
        if is_back and now >= self._certain_from and not newer():
            self._certain_from = None
        return self._certain_from is None
