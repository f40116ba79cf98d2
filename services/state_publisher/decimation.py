"""Which messages of a stream to pass on so that exactly the rate asked for comes out."""

from __future__ import annotations


class Decimator:
    """Passes messages at `rate` [Hz] on average whatever rate they come at; 0 passes all.

    The next message is due one period after the last one was DUE, not after it came: 25 Hz in at a limit of 20 gives
    20 out, and not 12.5.
    """

    def __init__(self, rate: float = 0.0) -> None:
        self.rate = rate
        self._due = 0  # [ns]
        self._carry = 0.0  # [ns] what the integer periods have lost
        self._last = 0  # [ns]

    def passes(self, stamp: int) -> bool:
        """Whether the message of `stamp` [ns] is to be passed on."""
        if self.rate <= 0.0:
            return True
        period = 1e9 / self.rate
        if stamp < self._last or stamp - self._due > 2.0 * period:
            self._due = stamp  # the clock jumped back, or the stream is slower or had stopped
        self._last = stamp
        if stamp < self._due:
            return False
        whole = int(period + self._carry)
        self._due, self._carry = self._due + whole, period + self._carry - whole
        return True
