"""Every command as a row: a knot as it was sent, and what the device answered. Pure.

Of a chunk that replaces the path's end there are the rows that count: those that the next one has not replaced.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from datetime import UTC, datetime

from gemelo.schemas.device import CommandAck, CommandChunk

ACK_TIMEOUT = 2_000_000_000  # [ns] after which an unanswered chunk counts as lost
OK = 0  # standard: firmware/PROTOCOL.md
SAME_TIME = 1e-7  # [s] rounding of a stream's time
LOST, RESENT, UNANSWERED = "lost", "resent", "unanswered"
MAX_EARLY = 64  # answers kept for a chunk that is still on its way here

Row = tuple[str, ...]


@dataclass(frozen=True)
class CommandRow:
    """One row of the table of these joints."""

    joints: tuple[str, ...]
    cells: Row


@dataclass(frozen=True)
class _PendingChunk:
    chunk: CommandChunk
    arrival: int  # [ns] UNIX time


class CommandLog:
    """Joins chunks with their acknowledgements, in the order in which the answers came."""

    def __init__(self) -> None:
        self.lost = 0  # chunks without an answer
        self.missing = 0  # chunks that never arrived here: gaps of the sequence number
        self.malformed = 0  # chunks whose tables do not fit together; they are in the MCAP only
        self._pending: dict[tuple[int, int], _PendingChunk] = {}
        self._early: dict[tuple[int, int], CommandAck] = {}
        self._replacing: tuple[CommandChunk, CommandAck] | None = None  # the newest that was taken
        self._newest: tuple[int, int] = (0, -1)  # stream, seq
        self._lines: list[CommandRow] = []

    @property
    def pending(self) -> int:
        """The number of chunks without an acknowledgement."""
        return len(self._pending)

    def on_chunk(self, chunk: CommandChunk, now: int) -> None:
        """Remember a chunk until its answer comes; one that is sent again ends the wait of the first."""
        if not is_well_formed(chunk):
            self.malformed += 1
            return
        self._count_missing(chunk)
        key = chunk.stream, chunk.seq
        first = self._pending.pop(key, None)
        if first is not None:
            self._lines += _lines(first.chunk, None, RESENT)
        early = self._early.pop(key, None)
        if early is None or early.stamp < chunk.stamp:
            self._pending[key] = _PendingChunk(chunk, now)
        else:
            self._take(chunk, early)

    def on_ack(self, ack: CommandAck) -> None:
        """Complete the rows of the chunk that is answered.

        Order is kept within a key only, so an answer may come before its chunk: it waits for it a while.
        """
        key = ack.stream, ack.seq
        waiting = self._pending.pop(key, None)
        if waiting is not None:
            self._take(waiting.chunk, ack)
            return
        self._early[key] = ack
        if len(self._early) > MAX_EARLY:
            del self._early[next(iter(self._early))]

    def step(self, now: int) -> list[CommandRow]:
        """The lines completed since the last call, those of lost chunks among them."""
        while self._pending:
            key, waiting = next(iter(self._pending.items()))
            if now - waiting.arrival < ACK_TIMEOUT:
                break
            del self._pending[key]
            self.lost += 1
            self._lines += _lines(waiting.chunk, None, LOST)
        lines, self._lines = self._lines, []
        return lines

    def finish(self, now: int) -> list[CommandRow]:
        """All lines that are left, with those still waiting marked as unanswered."""
        self._write_replacing()
        lines = self.step(now)
        for waiting in self._pending.values():
            lines += _lines(waiting.chunk, None, UNANSWERED)
        self._pending.clear()
        return lines

    def _take(self, chunk: CommandChunk, ack: CommandAck) -> None:
        """An answered chunk: one that replaces waits for the next one, which may void the end of it."""
        if ack.code == OK and chunk.replaces:
            self._write_replacing(chunk)
            self._replacing = chunk, ack
            return
        if chunk.stream != (self._replacing[0].stream if self._replacing is not None else chunk.stream):
            self._write_replacing()
        self._lines += _lines(chunk, ack, str(ack.code))

    def _write_replacing(self, following: CommandChunk | None = None) -> None:
        """The knots of the newest up to that from which the `following` one of its stream goes on; all without one."""
        if self._replacing is None:
            return
        (chunk, ack), self._replacing = self._replacing, None
        lines = _lines(chunk, ack, str(ack.code))
        is_cut = following is not None and following.stream == chunk.stream
        end = following.time + SAME_TIME if following is not None and is_cut else math.inf
        first = 0 if chunk.seq == 0 else 1  # the knot that it goes on from is in a row already
        self._lines += [line for knot, line in enumerate(lines) if knot >= first and _time(chunk, knot) <= end]

    def _count_missing(self, chunk: CommandChunk) -> None:
        stream, seq = self._newest
        expected = seq + 1 if chunk.stream == stream else 0
        self.missing += max(0, chunk.seq - expected) if stream else 0
        if chunk.stream != stream or chunk.seq > seq:
            self._newest = chunk.stream, chunk.seq


def header(joints: tuple[str, ...]) -> Row:
    """The columns: the seed's, then what came back. Positions in rad or m, rates per second of those."""
    motion = [f"{joint}_{quantity}" for joint in joints for quantity in ("pos", "vel", "acc")]
    answer = ["stream", "knot", "stream_time_s", "ack_timestamp_us", "ack_code", "round_trip_ms"]
    executed = [f"{joint}_executed_steps" for joint in joints]
    return ("seq", "timestamp_pc_us", "timestamp_pc_iso", *motion, "command_sent", *answer, *executed)


def is_well_formed(chunk: CommandChunk) -> bool:
    """True if every table is empty or has a row per knot and a column per joint, and steps fit 32 bits."""
    tables = (chunk.position, chunk.velocity, chunk.acceleration, chunk.steps, chunk.step_rate)
    shape = [len(chunk.name)] * len(chunk.steps)
    words = [word for table in (chunk.steps, chunk.step_rate) for row in table for word in row]
    return all([len(row) for row in table] in ([], shape) for table in tables) and all(
        -0x8000_0000 <= word <= 0x7FFF_FFFF for word in words
    )


def _lines(chunk: CommandChunk, ack: CommandAck | None, code: str) -> list[CommandRow]:
    when = (str(chunk.seq), str(chunk.stamp // 1000), iso(chunk.stamp))
    stamp = "" if ack is None else str(ack.stamp // 1000)
    round_trip = "" if ack is None or not ack.round_trip else f"{ack.round_trip * 1e3:.3f}"
    is_known = ack is not None and len(ack.steps) == len(chunk.name)
    executed = tuple(map(str, ack.steps)) if ack is not None and is_known else ("",) * len(chunk.name)
    return [
        CommandRow(
            chunk.name,
            (*when, *_motion(chunk, knot), _words(chunk, knot), str(chunk.stream), str(knot),
             f"{_time(chunk, knot):.6f}", stamp, code, round_trip, *executed),
        )
        for knot in range(len(chunk.steps))
    ]  # fmt: skip


def _motion(chunk: CommandChunk, knot: int) -> list[str]:
    tables = (chunk.position, chunk.velocity, chunk.acceleration)
    return [f"{table[knot][joint]:.9g}" if table else "" for joint in range(len(chunk.name)) for table in tables]


def _words(chunk: CommandChunk, knot: int) -> str:
    """The knot's bytes as they stand in a TRAJ frame: n positions, then n velocities, i32 little-endian."""
    words = (*chunk.steps[knot], *(chunk.step_rate[knot] if chunk.step_rate else ()))
    return struct.pack(f"<{len(words)}i", *words).hex()


def _time(chunk: CommandChunk, knot: int) -> float:
    """[s] of stream time."""
    late = max(0, knot - (len(chunk.steps) - 1 - max(0, chunk.tail)))  # knots of its tail
    return chunk.time + (knot - late) * chunk.dt + late * chunk.tail_dt


def iso(stamp: int) -> str:
    """UTC with microseconds, for example 2026-11-21T01:33:06.000250Z; `stamp` in ns UNIX."""
    seconds, nanoseconds = divmod(stamp, 1_000_000_000)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%dT%H:%M:%S}.{nanoseconds // 1000:06d}Z"
