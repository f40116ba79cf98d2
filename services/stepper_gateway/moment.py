"""One instant on both clocks of this machine."""

from __future__ import annotations

from typing import NamedTuple


class Moment(NamedTuple):
    """`unix` for stamps, `monotonic` for durations; the same instant."""

    unix: int  # [ns] UNIX time
    monotonic: float  # [s]

    @property
    def micros(self) -> int:
        """[us] on the monotonic clock: what SYNC frames carry."""
        return round(self.monotonic * 1e6)

    def unix_at(self, monotonic: float) -> int:
        """[ns] UNIX time of another instant of the monotonic clock."""
        return self.unix + round((monotonic - self.monotonic) * 1e9)


def next_beat(due: float, now: float, period: float) -> float:
    """The beat [s] after that of `due` [s] in a steady rhythm of `period` [s], or of a new rhythm after a pause."""
    return due + period if now - due < period else now + period
