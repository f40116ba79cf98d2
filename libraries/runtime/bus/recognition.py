"""Watch over a session that takes itself for connected: does the router still know it?

After a stand of the machine, in which both ends give a link up in the same instant, a session sometimes comes back with
a link that lives and is nothing to the router: it hears nobody, nobody hears it, and nothing tells it so (Zenoh
1.10.2). So it asks for a token of its own now and then: it answers that itself, and the router once more.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.handlers import Callback

ANSWERS = 2  # to a question for an own token: one of the session itself, one of the router


class Recognition:
    """The questions of one session; asked and looked at in one thread, answered in Zenoh's."""

    def __init__(self, longest: float) -> None:
        """`longest`: for how long [s] the router may give no sign that it knows the session."""
        self._longest = longest
        self._round = 0  # answers to questions of an earlier one do not count
        self._is_asking = False
        self._since: float | None = None  # [s] monotonic, of the oldest question that the router has left open
        self._was_known = False  # else this router answers in another way, and nothing is concluded
        self._is_denied = False
        self._was_served = False
        self._unserved_since: float | None = None  # [s] monotonic

    def begin_anew(self) -> None:
        """The session is not connected, which says enough."""
        self._round += 1
        self._is_asking, self._since, self._is_denied = False, None, False
        self._unserved_since = None

    @property
    def is_certain(self) -> bool:
        """True once the router has shown that it knows the session, and the one for urgent keys: it may forget both."""
        return self._was_known and self._was_served

    def ask(self, session: zenoh.Session, token: str) -> None:
        """Asks for `token`, which this session has declared, unless a question is under way."""
        if self._is_asking:
            return
        self._is_asking = True
        if self._since is None:
            self._since = time.monotonic()
        answers: list[Any] = []
        on_end = self._at_end(self._round, answers)
        session.liveliness().get(token, Callback(answers.append, on_end, indirect=False), timeout=self._longest)

    def complaint(self, now: float, is_served: bool) -> str:
        """Why the session is of no use at `now` [s] monotonic, empty if it is; call once a second.

        `is_served`: it sees by the router what this process serves in its session for urgent keys.
        """
        since = self._since
        if self._is_denied and since is not None and now - since > self._longest:
            return f"the router is there, but has not known this session for {self._longest:g} s"
        self._was_served = self._was_served or is_served
        self._unserved_since = None if is_served else self._unserved_since or now
        if self._was_served and self._unserved_since is not None and now - self._unserved_since > self._longest:
            return f"the router is there, but has not known the session for stops for {self._longest:g} s"
        return ""

    def _at_end(self, number: int, answers: list[Any]) -> Callable[[], None]:
        def on_end() -> None:
            if number == self._round:
                self._on_answers(sum(each.ok is not None for each in answers))

        return on_end

    def _on_answers(self, count: int) -> None:
        if count >= ANSWERS:
            self._was_known, self._is_denied, self._since = True, False, None
        else:
            self._is_denied = self._was_known
        self._is_asking = False
