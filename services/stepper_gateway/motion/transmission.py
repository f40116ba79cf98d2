"""Keeps the device's queue filled: never too far ahead to react, never too short to keep its speed."""

from __future__ import annotations

from gemelo.libraries.arm.model.description import Joint
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.links.frames import Chunk
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.knot_sources import KnotSource
from gemelo.services.stepper_gateway.motion.knots import Knot, StepEncoder
from gemelo.services.stepper_gateway.motion.live_stream import LiveStream
from gemelo.services.stepper_gateway.motion.stream import SentChunk, Stream

LARGEST_CHUNK = 20  # [knots] chosen: 0.4 s of path, in one frame also with eight joints
SMALLEST_CHUNK = 2  # [knots] 25 chunks a second at 20 ms; chosen: half as many frames as knots


class MotionTransmission:
    """The motion that is being sent and the stream it travels on."""

    def __init__(self, joints: tuple[Joint, ...], first_stream: int) -> None:
        self._joints = joints
        self._encoder = StepEncoder(joints)
        self._next_id = first_stream
        self.stream: Stream | None = None  # the present or the last one
        self._motion: KnotSource | None = None
        self._following: KnotSource | None = None
        self._start: Knot | None = None

    @property
    def is_open(self) -> bool:
        """True if knots can still be added to the stream."""
        return self.stream is not None and self.stream.is_open

    @property
    def owns_motion(self) -> bool:
        """True if the device plays what the gateway wants it to play."""
        return self.stream is not None and not self.stream.is_abandoned

    def begin(self, motion: KnotSource, start: Knot, boot_id: int, capacity: int) -> Stream:
        """A new stream from rest at `start`."""
        self.stream = Stream(self._take_id(), boot_id, self._joints, self._encoder, capacity)
        self._motion, self._following, self._start = motion, None, start
        return self.stream

    def begin_live(self, boot_id: int, capacity: int) -> LiveStream:
        """A new stream whose chunks replace one another; who makes them sends them."""
        stream = LiveStream(self._take_id(), boot_id, self._joints, self._encoder, capacity)
        self.stream = stream
        self._motion = self._following = self._start = None
        return stream

    def _take_id(self) -> int:
        stream_id, self._next_id = self._next_id, self._next_id % 0xFFFFFFFF + 1
        return stream_id

    def splice(self, motion: KnotSource) -> None:
        """Go on with another motion, which continues from the last knot sent."""
        self._motion, self._following = motion, None

    def follow(self, motion: KnotSource | None) -> None:
        """After the last knot of the present motion go on with another one, from rest; None: with none."""
        self._following = motion

    @property
    def has_following(self) -> bool:
        """True while the present motion has knots left, and another one follows it."""
        return self._following is not None

    def abandon(self) -> None:
        """Send nothing more of this stream, not even again."""
        self._motion = self._following = self._start = None
        if self.stream is not None:
            self.stream.is_abandoned = True
            self.stream.unacked.clear()

    def forget(self) -> None:
        """The stream's path means nothing any more: the steps are counted anew."""
        self.abandon()
        self.stream = None

    def pump(self, moment: Moment, clock: ClockSync, lead: float) -> list[tuple[Chunk, SentChunk]]:
        """Chunks to send now: late ones again, then new ones until `lead` [s] of path is on its way."""
        stream = self.stream
        if stream is None or stream.is_abandoned:
            return []
        chunks = list(stream.overdue(moment.monotonic))
        while (chunk := self._next_chunk(stream, moment, clock, lead)) is not None:
            chunks.append(chunk)
        return [(stream.frame(chunk, moment, clock), chunk) for chunk in chunks]

    def again(self, chunks: list[SentChunk], moment: Moment, clock: ClockSync) -> list[tuple[Chunk, SentChunk]]:
        """The same chunks once more."""
        stream = self.stream
        return [(stream.frame(chunk, moment, clock), chunk) for chunk in chunks] if stream is not None else []

    def _next_chunk(self, stream: Stream, moment: Moment, clock: ClockSync, lead: float) -> SentChunk | None:
        motion = self._motion
        if motion is None:
            return None
        played = stream.played_us(moment.monotonic, clock)
        dt = motion.dt_us * 1e-6
        missing = int((lead + self._braking(stream, played) - (stream.end_us - played) * 1e-6) / dt + 1e-3)
        count = min(missing, LARGEST_CHUNK, stream.credits(played))
        if count < SMALLEST_CHUNK:
            return None
        knots = motion.take(count - 1 if self._start is not None else count)
        if self._start is not None:
            knots.insert(0, self._start)
            self._start = None
        if motion.is_finished:
            self._motion, self._following = self._following, None
        return stream.add(knots, motion.dt_us, last=self._motion is None)

    def _braking(self, stream: Stream, played_us: int) -> float:
        """[s] half the longest stopping time on the way: with less, the device would slow down by itself."""
        return 0.5 * stream.log.longest_braking(played_us, stream.end_us)
