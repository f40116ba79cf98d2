"""Counts the steps and chunks that were commanded and executed, from the messages on the bus.

Two independent sources are compared: `commands` has the knots that were sent, and `device/state` the steps that the
device has emitted. Nothing is taken from the goals of the demonstration.

- following error: `step_errors`, which compares both sides at the same moment of the device's path.
- lost steps: when the device stands and reports that it has played a stream to its end, the last knot sent for it,
  rounded to the nearest step, minus the device's count. Every step lost during the stream is still missing there.
  A stream that was stopped before its end has no such knot; its move has failed anyway.
- chunks lost: chunks for which no `command_acks` ever said OK (or DUPLICATE, which is OK said twice). A chunk that
  replaces the path's end is never sent again: it is not lost where a later one was taken in its place.
"""

from __future__ import annotations

from gemelo.schemas.device import CommandAck, CommandChunk, DeviceMode, DeviceState
from gemelo.schemas.joints import StepErrors

OK, DUPLICATE = 0, 1  # firmware/PROTOCOL.md, codes of ACK
SAME_TIME = 1e-4  # [s]


class StepTotals:
    """Totals of all messages so far; complete when the arm stands."""

    def __init__(self) -> None:
        self.following: dict[str, float] = {}  # [steps] largest |commanded - executed|
        self.executed: dict[str, int] = {}  # [steps] the device's newest count
        self.round_trips: list[float] = []  # [s] from sending a chunk to its acknowledgement
        self._sent: set[tuple[int, int]] = set()  # (stream, seq)
        self._acknowledged: set[tuple[int, int]] = set()
        self._replacing: dict[tuple[int, int], CommandChunk] = {}  # (stream, seq), those that are not taken so far
        self._taken: dict[int, int] = {}  # by stream, seq of the newest replacing one that was taken
        self._last_knot: dict[int, dict[str, int]] = {}  # by stream [1/256 step]
        self._ends: dict[int, float] = {}  # by stream, when its last knot is due [s]
        self._streams: list[int] = []  # in the order of their first chunk
        self._differences: dict[int, dict[str, int]] = {}  # by stream [steps] at rest

    def on_errors(self, message: StepErrors) -> None:
        largest = message.max_error or (0.0,) * len(message.name)
        for name, error, worst in zip(message.name, message.error, largest, strict=False):
            self.following[name] = max(self.following.get(name, 0.0), abs(error), worst)

    def on_chunk(self, message: CommandChunk) -> None:
        self._sent.add((message.stream, message.seq))
        if message.stream not in self._streams:
            self._streams.append(message.stream)
        if message.replaces:
            self._replacing[(message.stream, message.seq)] = message
            self._replace(message.stream, message.seq)
        elif message.steps:
            self._keep_last_knot(message)

    def on_ack(self, message: CommandAck) -> None:
        if message.code in (OK, DUPLICATE):
            self._acknowledged.add((message.stream, message.seq))
            self._replace(message.stream, message.seq)
            self.round_trips.append(message.round_trip)

    def on_state(self, message: DeviceState) -> None:
        self.executed = dict(zip(message.name, message.steps, strict=True))
        knot = self._last_knot.get(message.stream)
        is_at_rest = message.mode is DeviceMode.IDLE and message.buffered == 0.0 and not any(message.velocity)
        if knot is not None and is_at_rest and message.play_time > self._ends[message.stream] - SAME_TIME:
            self._differences[message.stream] = {
                name: nearest_step(position) - self.executed[name] for name, position in knot.items()
            }

    def _replace(self, stream: int, seq: int) -> None:
        """A chunk that was sent and taken makes the path end elsewhere, perhaps sooner."""
        if (stream, seq) not in self._acknowledged or (stream, seq) not in self._replacing:
            return
        message = self._replacing.pop((stream, seq))
        if seq >= self._taken.get(stream, 0) and message.steps:
            self._taken[stream] = seq
            self._ends.pop(stream, None)
            self._keep_last_knot(message)

    def _keep_last_knot(self, message: CommandChunk) -> None:
        """A chunk that is sent again does not take the place of a later one."""
        end = message.time + (len(message.steps) - 1 - message.tail) * message.dt + message.tail * message.tail_dt
        if end >= self._ends.get(message.stream, 0.0):
            self._ends[message.stream] = end
            self._last_knot[message.stream] = dict(zip(message.name, message.steps[-1], strict=True))
            self._differences.pop(message.stream, None)

    @property
    def commanded(self) -> dict[str, int]:
        """Last commanded position [steps] of the newest stream, by joint."""
        if not self._streams:
            return dict(self.executed)
        return {name: nearest_step(q8) for name, q8 in self._last_knot.get(self._streams[-1], {}).items()}

    @property
    def chunks_sent(self) -> int:
        return len(self._sent)

    @property
    def chunks_lost(self) -> int:
        missing = self._sent - self._acknowledged
        return sum(seq >= self._taken.get(stream, 0) or (stream, seq) not in self._replacing for stream, seq in missing)

    @property
    def is_settled(self) -> bool:
        """True if the device was seen at rest at the end of the newest stream, so that its steps are accounted for."""
        return all(stream in self._differences for stream in self._streams[-1:])

    @property
    def lost_steps(self) -> int:
        """Lost steps, summed over all joints and all streams that came to rest."""
        return sum(abs(lost) for differences in self._differences.values() for lost in differences.values())


def nearest_step(position: int) -> int:
    """The position [1/256 step] rounded to whole steps as the firmware does: floor(p + 0.5)."""
    return (position + 128) >> 8
