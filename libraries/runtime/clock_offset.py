"""The difference between the clocks of two hosts, from a question and its answer."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

DRIFT = 200e-6  # [s/s] by which two clocks may run apart: twice what the worst crystal oscillator of a board does


class ClockOffset(msgspec.Struct, frozen=True):
    """What another clock shows more than ours: `offset` [s], and by how much at most that is wrong: `bound` [s]."""

    offset: float
    bound: float

    @property
    def may_agree(self) -> bool:
        """True if both clocks may show the same."""
        return abs(self.offset) <= self.bound

    def later(self, seconds: float) -> ClockOffset:
        """What is still known of it after `seconds` [s] in which both clocks may have drifted."""
        return ClockOffset(self.offset, self.bound + DRIFT * seconds)

    def to_own(self, stamp: int) -> int:
        """The moment [ns] of the other clock by ours; as it is where both may agree."""
        return stamp if self.may_agree else stamp - round(self.offset * 1e9)

    def __str__(self) -> str:
        return f"{1e3 * self.offset:+.1f} ±{1e3 * self.bound:.1f} ms"


def measured(asked: int, told: int, round_trip: float) -> ClockOffset:
    """From a question at `asked` [ns] by our clock, which the other answered with `told` [ns] by its own.

    The clock filter of NTP (RFC 5905, section 8): the other looked at its clock within the round trip [s], so half of
    that is the error's bound, however different both ways were.
    """
    half = round_trip / 2.0
    return ClockOffset((told - asked) / 1e9 - half, half)


def best(offsets: Iterable[ClockOffset]) -> ClockOffset | None:
    """The one that is known best; None where there is none."""
    return min(offsets, key=lambda each: each.bound, default=None)
