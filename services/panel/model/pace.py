"""The moments at which the arm is drawn: when a joint state brings something new, at most 25 times a second."""

from __future__ import annotations

PERIOD = 0.04  # [s] chosen: 25 pictures a second of an arm that moves
UNSEEN = 1e-5  # [rad] or [m] less of a joint is not drawn anew
EARLY = 0.01  # [s] half the time between two joint states, so that each picture is of one that has just come


class DrawPace:
    """One thread asks with every joint state, another one says what it has drawn.

    Nothing is due while the arm stands; its first move, and the place where it ends, are drawn as soon as they may.
    """

    def __init__(self) -> None:
        self._drawn: tuple[float, ...] = ()  # [rad] or [m]
        self._drawn_at = float("-inf")  # [s] monotonic

    def is_due(self, positions: tuple[float, ...], now: float) -> bool:
        """True if these joint values [rad] or [m] are to be drawn at `now` [s] monotonic."""
        return now - self._drawn_at >= PERIOD - EARLY and self._is_new(positions)

    def drawn(self, positions: tuple[float, ...], now: float) -> None:
        """These joint values [rad] or [m] have been drawn, beginning at `now` [s] monotonic."""
        if self._is_new(positions):
            self._drawn, self._drawn_at = positions, now

    def _is_new(self, positions: tuple[float, ...]) -> bool:
        if len(positions) != len(self._drawn):
            return True
        return any(abs(at - before) >= UNSEEN for at, before in zip(positions, self._drawn, strict=True))
