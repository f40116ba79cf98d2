"""One stream of chunks: sent in order, kept until acknowledged, sent again when lost."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.reasons import Reason, Value, because
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.links.frames import (
    NO_JOINT,
    Ack,
    BadFrame,
    Chunk,
    ChunkFlag,
    Code,
    Replacement,
    StateFrame,
    code_name,
)
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.commanded_path import CommandedPath
from gemelo.services.stepper_gateway.motion.knots import Knot, StepEncoder, StepKnot, braking_time
from gemelo.services.stepper_gateway.motion.path_version import PathPoint

TIME_TO_LIVE = 1_000_000  # [us] after which the device is to refuse a chunk; chosen: beyond any lead
RETRY_MIN, RETRY_MAX = 0.06, 0.3  # [s] until a chunk is sent again; chosen: three knots, and about the lead
GAP_RETRY = 0.02  # [s] until a gap that the device still reports is filled once more; chosen: until its next state
TRANSIENT = (Code.GAP, Code.NO_SPACE, Code.EXPIRED, Code.NOT_ARMED)  # NOT_ARMED: the drivers are only just on

UNITS: dict[int, str] = {  # of a refusal's value and limit, where they are no positions
    Code.VELOCITY_LIMIT: "steps/s",
    Code.NOT_AT_REST: "steps/s",
    Code.ACCELERATION_LIMIT: "steps/s^2",
}


@dataclass
class SentChunk:
    """A chunk that the device has not acknowledged yet."""

    seq: int
    dt_us: int
    flags: int
    steps: list[StepKnot]
    knots: list[Knot]
    time_us: int  # of its first knot along the stream
    replace: Replacement | None = None  # set: what the device has behind its first knot is void
    sent: float = 0.0  # [s] monotonic, the last time


@dataclass
class Stream:
    """The gateway's side of a stream; `id` names it on the wire."""

    id: int
    boot_id: int
    joints: tuple[Joint, ...]
    encoder: StepEncoder
    capacity: int  # [knots] of the device's queue
    log: CommandedPath = field(default_factory=CommandedPath)
    unacked: deque[SentChunk] = field(default_factory=deque)
    next_seq: int = 0
    acked: int = 0  # the device wants this one next
    is_complete: bool = False  # the LAST chunk has been sent
    is_abandoned: bool = False  # nothing more is to be sent
    failure: Reason | None = None  # why the device refuses it for good
    _credits: int = 0
    _play: StateFrame | None = None
    _round_trip: float = 0.02  # [s] smoothed

    def __post_init__(self) -> None:
        self._credits = self.capacity

    @property
    def end_us(self) -> int:
        """Stream time of the last knot sent."""
        return self.log.end_us

    @property
    def is_open(self) -> bool:
        """True if knots can still be added."""
        return not (self.is_complete or self.is_abandoned)

    @property
    def comes_to_rest(self) -> bool:
        """True if the knots that were sent end at rest."""
        return self.is_complete

    @property
    def is_finished(self) -> bool:
        """True if the device has played it to its end and rests there."""
        state = self._play
        return (
            self.is_complete
            and state is not None
            and state.mode == DeviceMode.IDLE
            and state.play_us >= self.end_us - 1
        )

    @property
    def has_started(self) -> bool:
        """True if the device has said that it plays this stream."""
        return self._play is not None or self.acked > 0

    def add(self, knots: list[Knot], dt_us: int, last: bool) -> SentChunk:
        """The next chunk; the very first knot of a stream is the present position at rest."""
        first = self.next_seq == 0
        flags = (ChunkFlag.FIRST if first else 0) | (ChunkFlag.LAST if last else 0)
        steps = [self.encoder.encode(knot) for knot in knots]
        time_us = 0 if first else self.end_us + dt_us
        for index, (step, knot) in enumerate(zip(steps, knots, strict=True)):
            self.log.append(time_us + index * dt_us, step, knot, braking_time(knot, self.joints))
        chunk = SentChunk(self.next_seq, dt_us, int(flags), steps, knots, time_us)
        self.next_seq += 1
        self._credits -= len(knots)
        self.is_complete = last
        self.unacked.append(chunk)
        return chunk

    def frame(self, chunk: SentChunk, moment: Moment, clock: ClockSync) -> Chunk:
        """The chunk as it goes out now, good for `TIME_TO_LIVE`."""
        chunk.sent = moment.monotonic
        return Chunk(
            boot_id=self.boot_id,
            stream=self.id,
            seq=chunk.seq,
            expires_us=clock.device_time(moment.monotonic) + TIME_TO_LIVE,
            dt_us=chunk.dt_us,
            flags=chunk.flags,
            positions=tuple(step.position for step in chunk.steps),
            velocities=tuple(step.velocity for step in chunk.steps),
            replace=chunk.replace,
        )

    def on_ack(self, ack: Ack, arrival: float) -> tuple[float, list[SentChunk]]:
        """Round trip [s] until `arrival` of the chunk, 0 if it is not known any more; and the chunks to send again now.

        Raises `BadFrame` for the answer to a chunk that was never sent.
        """
        self._require_sent(ack)
        chunk = next((c for c in self.unacked if c.seq == ack.seq), None)
        round_trip = arrival - chunk.sent if chunk is not None else 0.0
        if chunk is not None:
            self._round_trip += 0.125 * (round_trip - self._round_trip)
        if ack.seq < self.acked and ack.next_seq < self.acked:
            return round_trip, []
        self._acknowledge(ack.next_seq if ack.code != Code.WRONG_STREAM else 0)
        if ack.code in (Code.OK, Code.DUPLICATE):
            self._credits = ack.credits - sum(len(c.steps) for c in self.unacked)
            return round_trip, []
        if ack.code == Code.GAP or (ack.code == Code.WRONG_STREAM and not self.has_started):
            return round_trip, self._older_than(arrival - max(GAP_RETRY, 1.5 * self._round_trip))
        if ack.code not in TRANSIENT and not self.is_abandoned and ack.seq >= self.acked:
            self.failure = refusal(ack, self.joints)
        return round_trip, []

    def on_state(self, state: StateFrame) -> None:
        """A state whose stream is this one: acknowledges chunks, and says how far the path is played."""
        self._play = state
        self._acknowledge(min(state.next_seq, self.next_seq))
        self.log.prune(state.play_us)

    def overdue(self, now: float) -> list[SentChunk]:
        """Chunks whose acknowledgement is late at `now` [s] monotonic, oldest first."""
        patience = min(max(3.0 * self._round_trip + 0.02, RETRY_MIN), RETRY_MAX)
        if self.is_abandoned or not self.unacked or now - self.unacked[0].sent < patience:
            return []
        return self._older_than(now - GAP_RETRY)

    def played_us(self, now: float, clock: ClockSync) -> int:
        """[us] of stream time that is played at `now` [s] monotonic, by the latest state and the clock."""
        if self._play is None:
            return 0
        since = max(0, clock.device_time(now) - self._play.t_us)
        return min(self.end_us, self._play.play_us + int(since * self._play.time_scale))

    def commanded(self, state: StateFrame) -> PathPoint:
        """The path [steps] at the instant of `state`."""
        return self.log.at(state.play_us)

    def credits(self, played_us: int) -> int:
        """Knots that may be sent."""
        if self.unacked:
            return max(0, self._credits)
        waiting = self.log.count_between(played_us, self.end_us)
        return max(self._credits, self.capacity - waiting - 2, 0)

    def _require_sent(self, ack: Ack) -> None:
        """Raises `BadFrame` for the answer to a chunk that was never sent."""
        if ack.seq >= self.next_seq or (ack.code != Code.WRONG_STREAM and ack.next_seq > self.next_seq):
            raise BadFrame(f"an answer to chunk {max(ack.seq, ack.next_seq - 1)}, of {self.next_seq} that were sent")

    def _acknowledge(self, next_seq: int) -> None:
        self.acked = max(self.acked, min(next_seq, self.next_seq))
        while self.unacked and self.unacked[0].seq < self.acked:
            self.unacked.popleft()

    def _older_than(self, instant: float) -> list[SentChunk]:
        return [] if self.is_abandoned else [chunk for chunk in self.unacked if chunk.sent <= instant]


def refusal(ack: Ack, joints: tuple[Joint, ...]) -> Reason:
    """The device's refusal of a chunk; value and limit in the unit of its code, where it is about a joint."""
    chunk: dict[str, Value] = {"chunk": ack.seq, "answer": code_name(ack.code)}
    if ack.joint == NO_JOINT or ack.joint >= len(joints):
        return because("ending.chunk_refused", value=ack.value, limit=ack.limit, **chunk)
    return because(
        "ending.knot_refused",
        knot=ack.knot,
        joint=joints[ack.joint].name,
        value=ack.value / 256.0,
        limit=ack.limit / 256.0,
        unit=UNITS.get(ack.code, "steps"),
        **chunk,
    )
