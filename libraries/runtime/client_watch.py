"""Watch over clients by their liveliness tokens: an attached goal ends when the token of its client vanishes.

A router that goes away takes all tokens with it, so nothing is concluded while it is away, nor until the clients
have had the time to come back to it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from gemelo.libraries.runtime.bus.interface import Declaration

Watch = Callable[[str, Callable[[bool], None]], Declaration]

SETTLE = 0.2  # [s] from a token's end to a conclusion; a router that ends takes longer to be missed than its tokens
FIRST_SIGHT = 2.0  # [s] in which the token of a client that has just sent a goal must have been seen
RETURN = 5.0  # [s] that clients have to come back to a router: retry 0.5 s, open 1 s (zenoh_config), and as much again
LINGER = 60.0  # [s] that a client without a goal is watched: mostly the next one comes
MAX_IDLE = 32  # clients without a goal that are watched


@dataclass
class WatchedClient:
    """One client's token, and the goals that end with it."""

    missing_since: float | None  # [s] monotonic; None while the token is there
    patience: float  # [s] that it may be missing
    goals: set[str] = field(default_factory=set)
    idle_since: float = 0.0  # [s] monotonic, while it has no goals
    declarations: list[Declaration] = field(default_factory=list)

    def is_lost(self, now: float) -> bool:
        """True if its token has been missing for longer than it may, at `now` [s monotonic]."""
        return self.missing_since is not None and now - self.missing_since > self.patience


class ClientWatch:
    """Everything here runs in the thread of logic; `watch` calls back there, True when a token comes.

    A client is watched beyond its goal, so that its next one need not wait for a first sight of it.
    """

    def __init__(self, watch: Watch, is_connected: Callable[[], bool]) -> None:
        self._watch, self._is_connected = watch, is_connected
        self._clients: dict[str, WatchedClient] = {}  # by key of the token
        self._was_away = False
        self._back_at = float("-inf")  # [s] monotonic, when the router came back last
        self._now = 0.0  # [s] monotonic, of the last call

    def add(self, goal_id: str, client: str, now: float) -> None:
        """Watches `client`'s token [key] for the goal from `now` [s monotonic] on."""
        self._now = now
        watched = self._clients.get(client) or self._watched(client)
        if not watched.goals and watched.missing_since is not None:
            watched.missing_since, watched.patience = now, FIRST_SIGHT
        watched.goals.add(goal_id)

    def forget(self, goal_id: str) -> None:
        """The goal has ended."""
        for client in self._clients.values():
            if goal_id in client.goals:
                client.goals.remove(goal_id)
                client.idle_since = self._now

    def take_lost(self, now: float) -> list[tuple[str, str]]:
        """Goals whose client is gone at `now` [s monotonic], with its token; each is named once."""
        self._now = now
        self._drop_idle()
        if not self._is_connected():
            self._was_away = True
            return []
        if self._was_away:
            self._was_away, self._back_at = False, now
        if now - self._back_at < RETURN:
            return []
        gone = [key for key, client in self._clients.items() if client.goals and client.is_lost(now)]
        return [(goal_id, key) for key in gone for goal_id in sorted(self._dropped(key).goals)]

    def _watched(self, key: str) -> WatchedClient:
        client = self._clients[key] = WatchedClient(self._now, FIRST_SIGHT)

        def on_token(is_there: bool) -> None:
            if is_there:
                client.missing_since = None
            elif client.missing_since is None:
                client.missing_since, client.patience = self._now, SETTLE

        client.declarations.append(self._watch(key, on_token))
        return client

    def _drop_idle(self) -> None:
        """Those that have been without a goal for long, and of too many the ones that were so first."""
        idle = sorted((client.idle_since, key) for key, client in self._clients.items() if not client.goals)
        too_many = len(idle) - MAX_IDLE
        for place, (since, key) in enumerate(idle):
            if place < too_many or self._now - since > LINGER:
                self._dropped(key)

    def _dropped(self, key: str) -> WatchedClient:
        client = self._clients.pop(key)
        for declaration in client.declarations:
            declaration.close()
        return client


class Absence:
    """For how long one client's token has been missing, as far as that can be known."""

    def __init__(self, watch: Watch, is_connected: Callable[[], bool], client: str, now: float) -> None:
        """Watches `client`'s token [key] from `now` [s monotonic] on; the client has time to be seen first."""
        self._is_connected, self._was_away = is_connected, False
        self._sight_until = now + FIRST_SIGHT  # [s] monotonic, before which a token that never came is not missed
        self._counts_from = float("-inf")  # [s] monotonic: what was missing before may have been the router
        self._missing_since: float | None = now
        self._now = now
        self._declaration = watch(client, self._on_token)

    def seconds(self, now: float) -> float:
        """[s] that the token is missing at `now` [s monotonic]; 0 while it is there, or while that is not known."""
        self._now = now
        if not self._is_connected():
            self._was_away = True
            return 0.0
        if self._was_away:
            self._was_away, self._counts_from = False, now + RETURN
        if self._missing_since is None or now < self._sight_until:
            return 0.0
        return max(0.0, now - max(self._missing_since, self._counts_from))

    def close(self) -> None:
        """Watches no more."""
        self._declaration.close()

    def _on_token(self, is_there: bool) -> None:
        if is_there:
            self._missing_since, self._sight_until = None, float("-inf")
        elif self._missing_since is None:
            self._missing_since = self._now


class Absences:
    """The absence of every client of a list that changes."""

    def __init__(self, watch: Watch, is_connected: Callable[[], bool]) -> None:
        self._watch, self._is_connected = watch, is_connected
        self._of: dict[str, Absence] = {}

    def seconds(self, clients: Iterable[str], now: float) -> dict[str, float]:
        """[s] by client; those not named any more are not watched any more. `now` in [s] monotonic."""
        wanted = tuple(clients)
        for gone in self._of.keys() - set(wanted):
            self._of.pop(gone).close()
        for client in wanted:
            if client not in self._of:
                self._of[client] = Absence(self._watch, self._is_connected, client, now)
        return {client: self._of[client].seconds(now) for client in wanted}
