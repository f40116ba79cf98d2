"""When a picture of the arm is due: with the joint state that brings something new, but not more often than is seen."""

from __future__ import annotations

PERIOD = 0.04  # [s] chosen: 25 pictures a second of an arm that moves
EARLY = 0.01  # [s] half the time between two joint states, so that each picture is of one that has just come


class Pace:
    """One thread asks with every joint state, another one says what it has drawn.

    Nothing is due while the arm stands; its first move, and the place where it ends, are drawn as soon as they may.
    """

    def __init__(self) -> None:
        self._drawn: tuple[float, ...] = ()  # [rad] or [m]
        self._drawn_at = float("-inf")  # [s] monotonic

    def is_due(self, positions: tuple[float, ...], now: float) -> bool:
        """True if these joint values [rad] or [m] are to be drawn at `now` [s] monotonic."""
        return positions != self._drawn and now - self._drawn_at >= PERIOD - EARLY

    def drawn(self, positions: tuple[float, ...], now: float) -> None:
        """These joint values [rad] or [m] have been drawn, beginning at `now` [s] monotonic."""
        if positions != self._drawn:
            self._drawn, self._drawn_at = positions, now
