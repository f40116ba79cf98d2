"""The follower of one stream of targets on a device that replaces: a message at each target's arrival.

Each is the knots that follow the reference until a while after the newest target, and a full stop behind them: a
stream that dies needs nobody to stop the arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.chunk import Ahead
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.live_stream import LiveStream, Splice
from gemelo.services.stepper_gateway.motion.moving_tracker import NEAR_DT, MovingTracker, ReferenceAt, Tail
from gemelo.services.stepper_gateway.motion.path_version import PathVersion
from gemelo.services.stepper_gateway.motion.reference import Reference, SenderClock
from gemelo.services.stepper_gateway.motion.span_check import leaving

HOLDS = 0.11  # [s] after a target's arrival until the stop begins; chosen: one target of 30 Hz may be lost, and be late
LATE = 0.045  # [s] that a target may come late beyond one that was lost; chosen: a network's jitter
KNOTS = 144  # of one message, of all joints together, where that is enough for its stop; standard: firmware/PROTOCOL.md
LEAST_NEAR, MOST_NEAR = 2, 16  # [knots] chosen: less could not turn back, and an arm goes on blindly for 0.16 s at most
APART = 0.008  # [s] between two messages; chosen: of targets that come at once the newest counts
FINE = 0.025  # [s] between two places of a path that is looked at; chosen: a cubic bends by 1 mrad in that time
RENEWED = 0.04  # [s] between two messages of one chunk; chosen: four of them lie in what one plays
SAME_PLACE, SAME_SPEED = 1e-6, 1e-4  # [rad] or [m], and per second; chosen: below the wire's resolution


class Way(NamedTuple):
    """How a path is to be made."""

    share: float = 1.0  # of the way to the targets
    later: float = 0.0  # [s] until it is sent


class Proposal(NamedTuple):
    """The path that a message is to make: the knots behind a splice, and those of the stop."""

    splice: Splice
    near: list[Knot]
    near_us: int  # [us] between the near ones
    tail: list[Knot]
    tail_us: int
    version: PathVersion | None  # of the path that it goes on from; None: from rest

    def positions(self) -> tuple[Vector, ...]:
        """[rad] or [m] along it, from the splice on, `FINE` apart at most."""
        knots = [self.splice.knot, *self.near, *self.tail]
        spans = [self.near_us * 1e-6] * len(self.near) + [self.tail_us * 1e-6] * len(self.tail)
        rows, since = [knots[0].position], 0.0
        for before, after, span in zip(knots, knots[1:], spans, strict=False):
            if span > FINE:
                rows.append(_middle(before, after, span))
            since += span
            if since >= 2.0 * NEAR_DT * 1e-6 - 1e-9 or after is knots[-1]:
                rows.append(after.position)
                since = 0.0
        return tuple(rows)


class LiveFollower:
    """The reference of the newest targets, and the messages that lead the arm along it."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self._joints = joints
        self._tracker = MovingTracker(joints)
        self._clock = SenderClock()
        self._reference = Reference(joints)
        self._arrival = 0.0  # [s] monotonic, of the newest target
        self._delay = 0.0  # [s] by which targets are played late
        self._sent = -1.0e9  # [s] monotonic, when the newest message was made
        self.is_settled = False  # the arm does not come nearer to the last target
        self.is_pending = False  # the newest target is in no message that may reach the device

    @property
    def target(self) -> Vector:
        """[rad] or [m] the newest one."""
        return self._reference.newest

    def due(self, now: float) -> Vector:
        """[rad] or [m] the newest one that is due at `now` [s] monotonic."""
        return self._reference.due(now)

    def take(
        self, position: Vector, velocity: Vector, sent: float | None, arrival: float, ahead: Sequence[Ahead] = ()
    ) -> None:
        """A target, which came at `arrival` [s] monotonic; `sent` by the sender's stamp, None where it has none.

        `velocity` is empty where it is to be estimated; `ahead` are the targets that follow by themselves.
        """
        time = arrival if sent is None else self._clock.time_of(sent, arrival)
        if self._reference.take(time, position, velocity, ahead):
            self._arrival, self.is_pending, self.is_settled = arrival, True, False

    def is_due(self, now: float) -> bool:
        """True if a message is to be made at `now` [s] monotonic."""
        is_playing = now < self._leads_until and now - self._sent >= RENEWED
        return is_playing or (self.is_pending and now - self._sent >= APART)

    def message(
        self, stream: LiveStream | Knot, delay: float, catch_up: bool, moment: Moment, clock: ClockSync, way: Way
    ) -> Proposal | None:
        """The path to send now, the first one from rest; None if it changes nothing, or would leave the travel.

        `delay` [s] is by how much the targets are played late; `catch_up` also from far behind them.
        """
        now, self._delay = moment.monotonic, delay
        is_first = isinstance(stream, Knot)
        splice = (
            LiveStream.first(stream, now, clock) if isinstance(stream, Knot) else stream.splice(now, clock, way.later)
        )
        version = None if isinstance(stream, Knot) else stream.log.newest
        self.is_pending, self._sent = False, now
        near = self._near(splice, self._reference_on(splice, delay, way.share), catch_up and way.share == 1.0)
        if not is_first and splice.is_standing and _is_same(splice.knot, near[-1]):
            return None
        tail = self._tail(near)
        if self._leaves(splice, near, tail):
            near = self._near(splice, lambda _: (self.target, (0.0,) * len(self._joints)), catch_up=False)
            tail = self._tail(near)
            if self._leaves(splice, near, tail):
                return None
        return Proposal(splice, near, NEAR_DT, tail.knots, tail.dt_us, version)

    def _reference_on(self, splice: Splice, delay: float, share: float) -> ReferenceAt:
        """That of the targets; of a smaller `share` than 1, a place so far on the way to them, to rest at."""
        if share == 1.0:
            return lambda at: self._reference.at(at, delay)
        target, _ = self._reference.at(splice.begins + HOLDS, delay)
        place = tuple(a + share * (b - a) for a, b in zip(splice.knot.position, target, strict=True))
        return lambda _: (place, (0.0,) * len(place))

    def settling(self, stream: LiveStream, moment: Moment, clock: ClockSync, later: float) -> Proposal | None:
        """The path, sent `later` [s], that lets the arm rest at the last target, where no more targets come and it is
        near that; else None."""
        now, target, end = moment.monotonic, self.target, stream.log.last.position
        if self.is_settled or now < self._leads_until + self._patience or now - self._sent < APART:
            return None
        away = [abs(a - b) for a, b in zip(end, target, strict=True)]
        far = self._tracker.far(self._reference.velocity, catch_up=True)
        if max(away) < SAME_PLACE or any(a > b for a, b in zip(away, far, strict=True)):
            return None
        splice = stream.splice(now, clock, later)
        stop = self._tracker.settle(splice.knot, target, KNOTS // len(self._joints))
        if leaving(self._joints, [splice.knot, *stop.knots], [stop.dt_us * 1e-6] * len(stop.knots)) is not None:
            return None
        self._sent = now
        return Proposal(splice, stop.knots[:-1], stop.dt_us, stop.knots[-1:], stop.dt_us, stream.log.newest)

    @property
    def _leads_until(self) -> float:
        """[s] monotonic: the newest target's arrival, or when the last one ahead is played."""
        is_chunk = self._reference.planned_until > self._arrival
        return self._reference.planned_until + self._delay if is_chunk else self._arrival

    @property
    def _patience(self) -> float:
        """[s] from a target's arrival, or the last one that is due, until the next one is missed."""
        return max(HOLDS, 2.0 * self._reference.period + LATE)

    def _near(self, splice: Splice, reference: ReferenceAt, catch_up: bool) -> list[Knot]:
        """The knots until a stop is due if no more targets come."""
        count = math.ceil((self._leads_until + self._patience - splice.begins) * 1e6 / NEAR_DT)
        count = max(LEAST_NEAR, min(count, MOST_NEAR))
        return self._tracker.near(splice.knot, splice.begins, count, reference, catch_up)

    def _tail(self, near: list[Knot]) -> Tail:
        return self._tracker.tail(near[-1], KNOTS // len(self._joints) - len(near))

    def _leaves(self, splice: Splice, near: list[Knot], tail: Tail) -> bool:
        spans = [NEAR_DT * 1e-6] * len(near) + [tail.dt_us * 1e-6] * len(tail.knots)
        return leaving(self._joints, [splice.knot, *near, *tail.knots], spans) is not None


def _middle(before: Knot, after: Knot, span: float) -> Vector:
    """[rad] or [m] halfway on the cubic of `span` [s] between two knots."""
    rows = zip(before.position, after.position, before.velocity, after.velocity, strict=True)
    return tuple(0.5 * (p + q) + 0.125 * span * (v - w) for p, q, v, w in rows)


def _is_same(first: Knot, second: Knot) -> bool:
    """True if `second` stands where `first` does."""
    places = zip(first.position, second.position, strict=True)
    return all(abs(a - b) < SAME_PLACE for a, b in places) and all(abs(v) < SAME_SPEED for v in second.velocity)
