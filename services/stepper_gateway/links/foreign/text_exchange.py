"""The bookkeeping of lines and their answers: numbers, repetitions, losses, round trips. Pure.

A line that a newer one has replaced is not repeated: the board would go back to it.
"""

from __future__ import annotations

import statistics
from collections import OrderedDict, deque
from dataclasses import dataclass

from gemelo.services.stepper_gateway.links.foreign.text_messages import HALF, SEQ_MODULUS, LineAnswer

REMEMBERED = 256  # lines whose answers are told apart; chosen: more than a line is repeated in its patience
TRIPS = 2048  # latest round trips; chosen: enough for a 99th percentile
PATIENCE = 0.08  # [s] for an answer at first; chosen: both take 10 ms at 115,200 baud, and 16 more in a USB adapter
MOST_PATIENCE = 0.5  # [s] chosen: the arm stands by then, as after a lost heartbeat
RETRIES = 5  # of one line; chosen: noise spoils one, a board that is gone all


@dataclass
class SentLine:
    """One line that was sent, perhaps more than once."""

    payload: bytes
    first: float  # [s]
    latest: float  # [s]
    times: int = 1
    is_answered: bool = False
    is_lost: bool = False


@dataclass
class Counts:
    """Since the port was opened."""

    lines: int = 0
    acknowledged: int = 0
    refused: int = 0
    lost: int = 0  # no answer in time, however often it was repeated
    doubled: int = 0  # answers to what was answered already
    late: int = 0  # answers to what counted as lost
    strange: int = 0  # answers to what was never sent
    retries: int = 0
    backwards: int = 0  # time stamps that ran backwards: the board has restarted


class TextExchange:
    """One board's lines; `now` is [s] on any clock that only goes forward."""

    def __init__(self, first_seq: int = 1) -> None:
        self._seq = first_seq
        self._lines: OrderedDict[int, SentLine] = OrderedDict()
        self._trips: deque[float] = deque(maxlen=TRIPS)
        self._newest_stamp = -1
        self.counts = Counts()
        self.heard = -1.0e9  # [s] the latest answer

    @property
    def next_seq(self) -> int:
        """The number of the next line; wraps at 32 bits."""
        return self._seq

    @property
    def newest(self) -> SentLine | None:
        """The line that was sent last."""
        return next(reversed(self._lines.values())) if self._lines else None

    def is_newest(self, seq: int) -> bool:
        """True if `seq` is the number of the line that was sent last."""
        return bool(self._lines) and next(reversed(self._lines)) == seq

    def sent_at(self, seq: int) -> float:
        """[s] when line `seq`, which is remembered, was sent first."""
        return self._lines[seq].first

    def sent(self, payload: bytes, now: float) -> int:
        """A new line goes out at `now` [s]; its number."""
        seq, self._seq = self._seq, (self._seq + 1) % SEQ_MODULUS
        before = self.newest
        if before is not None and not before.is_answered and now - before.latest > self.patience:
            self._lose(before)
        self._lines[seq] = SentLine(payload, now, now)
        self.counts.lines += 1
        while len(self._lines) > REMEMBERED:
            _, old = self._lines.popitem(last=False)
            self._lose(old)
        return seq

    def on_answer(self, answer: LineAnswer, now: float) -> bool:
        """True if it, which came at `now` [s], is the first answer to a line."""
        self.heard = now
        line = self._lines.get(answer.seq)
        if line is None:
            self.counts.strange += 1
            return False
        if line.is_answered:
            self.counts.doubled += 1
            return False
        line.is_answered = True
        if line.is_lost:
            self.counts.late += 1
        if answer.stamp_us is None:
            self.counts.refused += 1
            return True
        self.counts.acknowledged += 1
        self._watch_stamp(answer.stamp_us)
        if line.times == 1:  # else it is not known which one it answers (Karn and Partridge, 1987)
            self._trips.append(now - line.first)
        return True

    def again(self, now: float) -> bytes | None:
        """The newest line, if its answer is late at `now` [s] and it may be repeated."""
        for line in list(self._lines.values())[:-1]:
            if not line.is_answered and now - line.latest > MOST_PATIENCE:
                self._lose(line)
        newest = self.newest
        if newest is None or newest.is_answered or now - newest.latest <= self.patience:
            return None
        if newest.times > RETRIES:
            self._lose(newest)
            return None
        newest.times, newest.latest = newest.times + 1, now
        self.counts.retries += 1
        return newest.payload

    @property
    def is_waiting(self) -> bool:
        """The newest line may still be answered, or repeated."""
        return self.newest is not None and not (self.newest.is_answered or self.newest.is_lost)

    @property
    def patience(self) -> float:
        """[s] for an answer."""
        return min(MOST_PATIENCE, max(PATIENCE, 3.0 * self.median)) if self._trips else PATIENCE

    @property
    def median(self) -> float:
        """[s] of the latest round trips; 0 where there is none."""
        return statistics.median(self._trips) if self._trips else 0.0

    @property
    def p99(self) -> float:
        """[s] of the latest round trips; 0 where there is none."""
        ordered = sorted(self._trips)
        return ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))] if ordered else 0.0

    def summary(self) -> str:
        """A line for people."""
        c = self.counts
        return (
            f"{c.lines} lines, {c.acknowledged} acknowledged, {c.refused} refused, {c.lost} lost, {c.doubled} doubled, "
            f"{c.late} late, {c.retries} repeated; round trip {1e3 * self.median:.1f} ms median, "
            f"{1e3 * self.p99:.1f} ms p99"
        )

    def _lose(self, line: SentLine) -> None:
        if not line.is_answered and not line.is_lost:
            line.is_lost = True
            self.counts.lost += 1

    def _watch_stamp(self, stamp_us: int) -> None:
        # A board's micros() is often 32 bits wide, and wraps after 71 minutes.
        if self._newest_stamp >= 0 and 0 < (self._newest_stamp - stamp_us) % SEQ_MODULUS < HALF:
            self.counts.backwards += 1
        self._newest_stamp = stamp_us
