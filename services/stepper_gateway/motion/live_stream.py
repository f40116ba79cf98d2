"""One stream whose chunks replace one another: each is the next knots of the path and a full stop behind them.

A lost or late replacement is never sent again: a fresh one takes its place, and meanwhile the device plays what it has,
with its own stop. Only the first chunk and the end of the stream are repeated until the device has them.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from gemelo.schemas.reasons import Reason
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.links.frames import Ack, Chunk, ChunkFlag, Code, Replacement, StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knots import Knot, braking_time
from gemelo.services.stepper_gateway.motion.path_version import PathPoint, PathVersion
from gemelo.services.stepper_gateway.motion.stream import TRANSIENT, SentChunk, Stream, refusal

SLOTS = 2500.0  # [us] from the arrival of a frame to the slot that plays it; chosen: two slots, and half of one
SURE = 0.95  # share of the frames that arrive before their knot is played; chosen: more costs more lag than it saves
PATIENCE = 0.005  # [s] beyond one and a half round trips, after which a chunk counts as lost; chosen: five slots
DELAYS = 100  # chosen: three seconds of 30 Hz
UNANSWERED = 2.0  # [s] after which no answer comes any more; chosen: far beyond a network's delays
LAST_DT = 20_000  # [us] of the knot that ends the stream where it rests; chosen: as of every other motion
SUPERSEDED = (*TRANSIENT, Code.LATE, Code.OTHER_KNOT, Code.NO_STOP)  # a fresh one may be taken
LIMITED = (Code.POSITION_LIMIT, Code.VELOCITY_LIMIT, Code.ACCELERATION_LIMIT)  # as well, and somebody is to know


class Splice(NamedTuple):
    """A knot of the path, from which it can still be replaced."""

    from_us: int  # stream time
    knot: Knot
    begins: float  # [s] monotonic, when the device plays it
    is_standing: bool  # the path has been played to its end, which this is


class _Sent(NamedTuple):
    at: float  # [s] monotonic
    device_us: int  # the device's time then
    is_given_up: bool = False


class _Departure(NamedTuple):
    """The device leaves its rest with this chunk; it does not say so before its next state."""

    device_us: float  # at the earliest
    from_us: int  # stream time
    seq: int


@dataclass
class LiveStream(Stream):
    """The gateway's side of it."""

    is_ending: bool = False  # the stream is to end where it rests
    complaint: Reason | None = None  # why a replacement was refused, where a fresh one may fare no better
    wants_fresh: bool = False  # the newest targets should be sent anew: the device has not got them
    _under_way: dict[int, _Sent] = field(default_factory=dict)  # by chunk
    _delays: deque[float] = field(default_factory=lambda: deque(maxlen=DELAYS))  # [us] from here to the device
    _half_trip: float = 0.0  # [us] as the clocks' exchanges have it
    _confirmed: int = -1  # the newest chunk that the device has taken
    _departure: _Departure | None = None

    @property
    def is_open(self) -> bool:
        """False: nothing is appended to it."""
        return False

    @property
    def comes_to_rest(self) -> bool:
        """True: whatever the device has of it ends at rest."""
        return True

    @property
    def is_begun(self) -> bool:
        """True if the device has taken the first chunk: only then can it be replaced."""
        return self._confirmed >= 0

    def splice(self, now: float, clock: ClockSync, later: float = 0.0) -> Splice:
        """From where the path can be replaced by a chunk that is sent `later` [s] than `now` [s] monotonic."""
        self._half_trip = 0.5e6 * clock.round_trip
        self._give_up(now)
        now += later
        played, newest = self.played_us(now, clock), self.log.newest
        index = newest.next_after(played + round(self._delay(SURE) + SLOTS))
        from_us, knot = newest.times[index], newest.knots[index]
        is_standing = index == len(newest.times) - 1 and played >= newest.times[-1]
        wait = self._delay(0.5) + SLOTS if is_standing else from_us - played
        return Splice(from_us, knot, now + wait * 1e-6, is_standing)

    def begin(self, clock: ClockSync) -> None:
        """Know how long the wire takes as the clocks' exchanges have it, before anything is sent."""
        self._half_trip = 0.5e6 * clock.round_trip

    @staticmethod
    def first(start: Knot, now: float, clock: ClockSync) -> Splice:
        """That of the first chunk, from rest at `start`, sent at `now` [s] monotonic."""
        return Splice(0, start, now + (0.5e6 * clock.round_trip + SLOTS) * 1e-6, is_standing=True)

    def replace(self, splice: Splice, near: list[Knot], near_dt: int, tail: list[Knot], tail_dt: int) -> SentChunk:
        """The chunk after which the path goes on from `splice` by `near`, and comes to rest by `tail`."""
        flags = ChunkFlag(0) if self.next_seq else ChunkFlag.FIRST
        behind = Replacement(from_us=splice.from_us, tail=len(tail), tail_dt_us=tail_dt)
        return self._replace(splice, [*near, *tail], flags, near_dt, behind)

    def end(self) -> None:
        """Let the stream end where its path comes to rest."""
        self.is_ending = True

    def frame(self, chunk: SentChunk, moment: Moment, clock: ClockSync) -> Chunk:
        device_us = clock.device_time(moment.monotonic)
        self._under_way[chunk.seq] = _Sent(moment.monotonic, device_us)
        if self._departure is not None and self._departure.seq == chunk.seq:
            self._departure = self._departure._replace(device_us=device_us + self._delay(0.0))
        return super().frame(chunk, moment, clock)

    def on_ack(self, ack: Ack, arrival: float) -> tuple[float, list[SentChunk]]:
        """The round trip [s] until `arrival`, as of other streams; nothing is to be sent again at once."""
        self._require_sent(ack)
        sent = self._under_way.pop(ack.seq, None)
        if sent is not None:
            self._delays.append(float(ack.t_us - sent.device_us))
            self._round_trip += 0.125 * (arrival - sent.at - self._round_trip)
        if ack.code in (Code.OK, Code.DUPLICATE):
            self._confirm(ack.next_seq)
        else:
            self._refuse(ack)
        self.is_complete = self.log.newest.ends
        return (arrival - sent.at if sent is not None else 0.0), []

    def on_state(self, state: StateFrame) -> None:
        self._play = state
        self._confirm(min(state.next_seq, self.next_seq))
        self.is_complete = self.log.newest.ends
        self.log.prune(state.play_us, state.next_seq)
        departure = self._departure
        if departure is not None and state.next_seq > departure.seq and state.play_us > departure.from_us:
            self._departure = None

    def overdue(self, now: float) -> list[SentChunk]:
        """At `now` [s] monotonic: the first chunk, as long as it is not acknowledged; the end of the stream, where that
        is not under way."""
        self._give_up(now)
        if self.unacked or not self.is_ending or self.is_complete or self.is_abandoned:
            return super().overdue(now)
        rest, end = Knot.at_rest(self.log.last.position), self.end_us
        at_end = Splice(end, rest, now, is_standing=False)
        behind = Replacement(from_us=end, tail=1, tail_dt_us=LAST_DT)
        return [self._replace(at_end, [rest], ChunkFlag.LAST, LAST_DT, behind)]

    def played_us(self, now: float, clock: ClockSync) -> int:
        """[us] of stream time that is played at `now` [s] monotonic; from rest, what may be played at the most."""
        played, departure = super().played_us(now, clock), self._departure
        if departure is not None:
            since = max(0.0, clock.device_time(now) - departure.device_us)
            played = max(played, departure.from_us + int(since))
        return min(self.end_us, played)

    def commanded(self, state: StateFrame) -> PathPoint:
        return self.log.at(state.play_us, state.next_seq)

    def _replace(
        self, splice: Splice, behind: list[Knot], flags: ChunkFlag, dt_us: int, replacement: Replacement
    ) -> SentChunk:
        """The chunk that goes on from `splice` by the knots `behind`."""
        newest, knots = self.log.newest, [splice.knot, *behind]
        steps = [self.encoder.encode(knot) for knot in knots]
        if self.next_seq:  # bit by bit the knot that the device has
            steps[0] = newest.steps[newest.next_after(splice.from_us)]
        version = PathVersion(self.next_seq, ends=bool(flags & ChunkFlag.LAST))
        time_us = splice.from_us
        for index, (step, knot) in enumerate(zip(steps, knots, strict=True)):
            if index:
                is_tail = index >= len(knots) - replacement.tail
                time_us += replacement.tail_dt_us if is_tail else dt_us
            version.append(time_us, step, knot, braking_time(knot, self.joints))
        self.log.replace(version)
        chunk = SentChunk(self.next_seq, dt_us, int(flags), steps, knots, splice.from_us, replacement)
        if flags & ChunkFlag.FIRST:
            self.unacked.append(chunk)
        if splice.is_standing:
            self._departure = _Departure(0.0, splice.from_us, self.next_seq)
        self.next_seq += 1
        self.is_complete = version.ends
        return chunk

    def _confirm(self, next_seq: int) -> None:
        """The device wants `next_seq` next: it has taken the chunk before that."""
        self.wants_fresh = self.wants_fresh or (self._confirmed < 0 < next_seq)
        self._confirmed = max(self._confirmed, next_seq - 1)
        self.log.revive(next_seq - 1)
        self._acknowledge(next_seq)

    def _refuse(self, ack: Ack) -> None:
        """What the device has then is as without that chunk, and without those before it that it has not taken."""
        if ack.code == Code.WRONG_STREAM and (not self.has_started or self.is_ending):
            return self.log.forget(max(1, ack.seq), ack.seq)
        if ack.seq == 0:
            if ack.code not in TRANSIENT and not self.is_abandoned and not self.is_begun:
                self.failure = refusal(ack, self.joints)
            return None
        if ack.code in LIMITED:
            self.complaint = refusal(ack, self.joints)
        elif ack.code in SUPERSEDED:
            self.wants_fresh = True
        elif not self.is_abandoned:
            self.failure = refusal(ack, self.joints)
        self.log.forget(max(self._confirmed + 1, ack.next_seq, 1), ack.seq)
        return None

    def _give_up(self, now: float) -> None:
        """Chunks that nobody has answered count as lost: what goes on from their knots would be refused for ever.

        Their answers may still come, and say how long the wire takes.
        """
        patience = 1.5e-6 * (self._delay(SURE) + self._half_trip) + PATIENCE
        for seq, sent in list(self._under_way.items()):
            if now - sent.at > UNANSWERED:
                del self._under_way[seq]
            elif now - sent.at > patience and not sent.is_given_up:
                self._under_way[seq] = sent._replace(is_given_up=True)
                if seq > max(0, self._confirmed):
                    self.log.forget(seq, seq)
                    self.is_complete = self.log.newest.ends

    def _delay(self, share: float) -> float:
        """[us] that `share` of the chunks took to the device at most."""
        if not self._delays:
            return self._half_trip
        ordered = sorted(self._delays)
        return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
