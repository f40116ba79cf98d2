"""The lines of dialect "text": `<SEQ,J1,...,Jn>` out, `<ACK,SEQ,TIMESTAMP_US>` and `<NAK,SEQ,REASON>` in. Pure."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

LONGEST = 64  # [bytes] of an answer; chosen: half as much again as the longest one
SEQ_MODULUS = 1 << 32  # standard: numbers of 32 bits in the dialect
HALF = SEQ_MODULUS // 2

_ANSWER = re.compile(rb"<(ACK|NAK),(\d{1,10}),([A-Za-z0-9_ ]{1,24})>")


class LineAnswer(NamedTuple):
    """What the board says to one line."""

    seq: int
    stamp_us: int | None  # of the board's clock; None where it refuses the line
    refusal: str = ""


def line_of(seq: int, positions: Sequence[float], decimals: int) -> bytes:
    """A target [rad] or [m] for every joint, absolute."""
    return f"<{seq},{','.join(f'{position:z.{decimals}f}' for position in positions)}>\n".encode()


def read_answer(frame: bytes) -> LineAnswer | None:
    """`frame` from `<` to `>`; None for what is no answer."""
    match = _ANSWER.fullmatch(frame)
    if match is None or int(match[2]) >= SEQ_MODULUS:
        return None
    seq, rest = int(match[2]), match[3].decode()
    if match[1] == b"NAK":
        return LineAnswer(seq, None, rest)
    return LineAnswer(seq, int(rest)) if rest.isdecimal() and int(rest) < 1 << 64 else None


class AnswerReader:
    """Cuts a stream of bytes into answers, and counts what is no answer: boot messages, torn lines, noise."""

    def __init__(self) -> None:
        self.rest = b""  # of an answer that is not there yet
        self.bad = 0

    def feed(self, data: bytes) -> list[LineAnswer]:
        """The answers that are complete now, oldest first."""
        self.rest += data
        found: list[LineAnswer] = []
        while (end := self.rest.find(b">")) >= 0:
            start = self.rest.rfind(b"<", 0, end)
            frame, self.rest = self.rest[max(0, start) : end + 1], self.rest[end + 1 :]
            answer = read_answer(frame)
            if answer is None:
                self.bad += 1
            else:
                found.append(answer)
        if len(self.rest) > LONGEST:
            self.rest = self.rest[-LONGEST:]
        return found
