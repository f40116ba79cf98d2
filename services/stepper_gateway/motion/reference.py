"""The reference of streamed targets: where their sender is and how fast it goes, at every moment, from stamped samples.

Targets at times ahead are samples that are not due yet, on a curve through them. Else its place and velocity
are those of the parabola through the last samples of a joint, extrapolated straight. A target that no motion within the
arm's limits explains is a jump: a place to go to, where the reference stands.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.joints import MOST_AHEAD
from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.motion.chunk import Ahead, curve_rates, on_cubic
from gemelo.services.stepper_gateway.motion.knots import Limits

FITTED = 5  # samples of a parabola; measured: fewer follow a sender's rounding, more come late
LEAST_FITTED = 4  # chosen: a parabola through three samples has their whole noise
FINEST = 0.009  # [s] between two samples; chosen: a sender of 100 Hz keeps all of its targets, faster ones are thinned
PAUSE = 0.3  # [s] between two targets, after which a sender begins anew; chosen: beyond a game pad's slowest rate
EXTRAPOLATED = 0.15  # [s] beyond the newest sample, after which the reference stands; chosen: four targets of 30 Hz
KEPT = 64  # samples; chosen: 0.6 s of the fastest sender, beyond every delay
GRAIN = {"rad": 0.003, "m": 0.001}  # by which a sender's positions are coarse; chosen: two steps of a 12-bit servo
SOONER = 2.0  # times a joint's acceleration, which a sender's may be; chosen: beyond it the arm could not follow
FASTEST = 0.95  # of a joint's velocity, which a reference has; chosen: the rest is for catching up
DELAYS = 60  # stamps whose delays are compared; chosen: two seconds of 30 Hz, in which clocks part by nothing


class SenderClock:
    """Maps the stamps of one sender to our clock: the least delay of late counts as none."""

    def __init__(self) -> None:
        self._offsets: deque[float] = deque(maxlen=DELAYS)

    def time_of(self, stamp: float, arrival: float) -> float:
        """[s] of our monotonic clock, when a target was sent that came at `arrival`; `stamp` is on the sender's."""
        if self._offsets and arrival - stamp > min(self._offsets) + PAUSE:
            self._offsets.clear()  # its clock was set back
        self._offsets.append(arrival - stamp)
        return stamp + min(self._offsets)


class Sample(NamedTuple):
    """One target of all joints."""

    time: float  # [s] monotonic, when it was sent
    position: Vector  # [rad] or [m]
    velocity: Vector  # [rad/s] or [m/s] given, or estimated; 0 at a jump
    slope: Vector  # [rad/s] or [m/s] from the sample before
    smooth: tuple[int, ...]  # samples since the joint's latest jump, its own included; 0: the velocity was given
    is_curved: bool = False  # a cubic leads here, else a straight line


class Reference:
    """The samples of one stream, and what they say of every moment."""

    def __init__(self, joints: tuple[Joint, ...]) -> None:
        self._limits = Limits.of(joints)
        self._grains = tuple(GRAIN[joint.unit] for joint in joints)
        self._samples: deque[Sample] = deque(maxlen=KEPT + MOST_AHEAD)
        self._taken = -1.0e9  # [s] monotonic, when the newest target was sent
        self._parabolas: dict[int, Parabola] = {}  # by column

    @property
    def newest(self) -> Vector:
        """[rad] or [m] the newest target."""
        return self._samples[-1].position

    @property
    def velocity(self) -> Vector:
        """[rad/s] or [m/s] of the newest target."""
        return self._samples[-1].velocity

    @property
    def period(self) -> float:
        """[s] between the last two targets; 0 for a single one, and where targets ahead are the newest."""
        if len(self._samples) < 2 or self.planned_until > self._taken:
            return 0.0
        return self._samples[-1].time - self._samples[-2].time

    @property
    def planned_until(self) -> float:
        """[s] monotonic, of the newest sample, which may lie ahead."""
        return self._samples[-1].time

    def due(self, time: float) -> Vector:
        """[rad] or [m] the newest target that is due at `time` [s] monotonic, or the place between two."""
        return self.newest if time >= self._samples[-1].time else self._straight(time)[0]

    def take(self, time: float, position: Vector, velocity: Vector = (), ahead: Sequence[Ahead] = ()) -> bool:
        """A target that was sent at `time` [s] monotonic; `velocity` where the sender says it. False: overtaken.

        What was to be due later than that is forgotten, and `ahead` takes its place.
        """
        samples = self._samples
        if samples and self._taken - PAUSE < time <= self._taken:
            return False
        is_planned = bool(samples) and self._taken < time < samples[-1].time
        while samples and samples[-1].time >= time:
            samples.pop()
        if samples and not is_planned and not self._taken < time <= samples[-1].time + PAUSE:
            samples.clear()
        if len(samples) > 1 and time - samples[-2].time < FINEST:
            samples.pop()
        sample, self._taken = self._sample(time, position, velocity), time
        samples.extend(self._planned(sample, velocity, ahead) if ahead else [sample])
        self._parabolas = self._fitted()
        return True

    def at(self, moment: float, delay: float) -> tuple[Vector, Vector]:
        """Place [rad] or [m] and velocity [rad/s] or [m/s] for `moment` [s] monotonic, played `delay` late."""
        time = moment - delay
        position, velocity = self._straight(time)
        if not self._parabolas:
            return position, velocity
        places, rates = list(position), list(velocity)
        ahead = time - self._samples[-1].time
        for column, parabola in self._parabolas.items():
            if ahead >= parabola.begin:
                places[column], rates[column] = parabola.at(ahead)
        return tuple(places), tuple(rates)

    def _straight(self, time: float) -> tuple[Vector, Vector]:
        """Between the samples themselves, on the curve of a chunk, and beyond the newest one with its velocity."""
        newest = self._samples[-1]
        ahead = time - newest.time
        if ahead >= 0.0:
            reach = min(ahead, EXTRAPOLATED)
            place = tuple(p + v * reach for p, v in zip(newest.position, newest.velocity, strict=True))
            return place, newest.velocity if ahead <= EXTRAPOLATED else (0.0,) * len(place)
        for second, first in pairwise(reversed(self._samples)):
            if time >= first.time:
                share = (time - first.time) / (second.time - first.time)
                if second.is_curved:
                    return _on_curve(first, second, share)
                return _between(first.position, second.position, share), _between(
                    first.velocity, second.velocity, share
                )
        return self._samples[0].position, (0.0,) * len(newest.position)

    def _sample(self, time: float, position: Vector, velocity: Vector) -> Sample:
        zeros = (0.0,) * len(position)
        if velocity:
            given = self._bounded(velocity)
            return Sample(time, position, given, given, (0,) * len(position))
        if not self._samples:
            return Sample(time, position, zeros, zeros, (1,) * len(position))
        last = self._samples[-1]
        dt = time - last.time
        slope = tuple((b - a) / dt for a, b in zip(last.position, position, strict=True))
        smooth = tuple(self._smooth(column, dt, slope[column]) for column in range(len(position)))
        estimated = tuple(
            self._estimated(column, dt, slope[column]) if smooth[column] > 1 else 0.0 for column in range(len(position))
        )
        return Sample(time, position, estimated, slope, smooth)

    def _planned(self, first: Sample, velocity: Vector, ahead: Sequence[Ahead]) -> list[Sample]:
        """The samples of a chunk that begins with `first`, whose `velocity` may be given."""
        before = self._samples[-1] if self._samples else None
        rates = [self._rates(column, before, first, ahead) for column in range(len(first.position))]
        times = [first.time, *(first.time + each.time for each in ahead)]
        places = [first.position, *(each.position for each in ahead)]
        given = [velocity, *(each.velocity for each in ahead)]
        is_joined = before is not None and all(count != 1 for count in first.smooth)
        found = []
        for index, (time, place) in enumerate(zip(times, places, strict=True)):
            rate = self._bounded(given[index] or tuple(row[index] for row in rates))
            found.append(Sample(time, place, rate, rate, (0,) * len(place), is_curved=index > 0 or is_joined))
        return found

    def _rates(self, column: int, before: Sample | None, first: Sample, ahead: Sequence[Ahead]) -> list[float]:
        """Of one joint at `first` and at each target `ahead`; a jump to the first has no part in them."""
        times = [0.0, *(each.time for each in ahead)]
        values = [first.position[column], *(each.position[column] for each in ahead)]
        if before is None or first.smooth[column] == 1:
            return curve_rates(times, values)
        return curve_rates([before.time - first.time, *times], [before.position[column], *values])[1:]

    def _bounded(self, rate: Vector) -> Vector:
        fastest = [FASTEST * top for top in self._limits.velocity]
        return tuple(max(-top, min(v, top)) for v, top in zip(rate, fastest, strict=True))

    def _smooth(self, column: int, dt: float, slope: float) -> int:
        """Samples since the latest jump; 1: this one is where neither velocity nor slope of before leads to."""
        last = self._samples[-1]
        sooner = SOONER * self._limits.acceleration[column] * dt + self._grains[column] / dt
        nearest = min(abs(slope - last.velocity[column]), abs(slope - last.slope[column]))
        return last.smooth[column] + 1 if nearest <= sooner else 1

    def _estimated(self, column: int, dt: float, slope: float) -> float:
        """The slope, as far as the arm could follow it from the velocity before."""
        before, sooner = self._samples[-1].velocity[column], SOONER * self._limits.acceleration[column] * dt
        fastest = FASTEST * self._limits.velocity[column]
        return max(-fastest, min(before + max(-sooner, min(slope - before, sooner)), fastest))

    def _fitted(self) -> dict[int, Parabola]:
        """The parabolas of the joints that have moved without a jump of late, by column."""
        counts = [min(FITTED, smooth, len(self._samples)) for smooth in self._samples[-1].smooth]
        found: dict[int, Parabola] = {}
        for count in {count for count in counts if count >= LEAST_FITTED}:
            used = list(self._samples)[-count:]
            times = [sample.time - used[-1].time for sample in used]
            weights = parabola_weights(times)
            for column in [column for column, each in enumerate(counts) if each == count]:
                values = [sample.position[column] for sample in used]
                place, rate, bend = (sum(w * p for w, p in zip(row, values, strict=True)) for row in weights)
                fastest = FASTEST * self._limits.velocity[column]
                found[column] = Parabola(place, max(-fastest, min(rate, fastest)), bend, times[0])
        return found


class Parabola(NamedTuple):
    """One joint's place over the time [s] since the newest sample."""

    place: float  # [rad] or [m]
    rate: float  # [rad/s] or [m/s]
    bend: float  # [rad/s^2] or [m/s^2] half of its acceleration
    begin: float  # [s] of its first sample, negative

    def at(self, time: float) -> tuple[float, float]:
        """Place and velocity at `time` [s]; straight after 0, and at rest after `EXTRAPOLATED`."""
        if time > 0.0:
            rate = self.rate if time <= EXTRAPOLATED else 0.0
            return self.place + self.rate * min(time, EXTRAPOLATED), rate
        return self.place + time * (self.rate + time * self.bend), self.rate + 2.0 * time * self.bend


def parabola_weights(times: Sequence[float]) -> tuple[Vector, Vector, Vector]:
    """By which the values at `times` [s] give place, slope and bend at 0 of the parabola that fits them best.

    By polynomials that are orthogonal on those times (Forsythe 1957), so that no system of equations is solved.
    """
    count = len(times)
    mean = sum(times) / count
    first = [t - mean for t in times]
    square = sum(p * p for p in first)
    b, c = sum(t * p * p for t, p in zip(times, first, strict=True)) / square, square / count
    second = [(t - b) * p - c for t, p in zip(times, first, strict=True)]
    fourth = sum(p * p for p in second)
    place = tuple(
        1.0 / count - mean * p / square + (b * mean - c) * q / fourth for p, q in zip(first, second, strict=True)
    )
    slope = tuple(p / square - (b + mean) * q / fourth for p, q in zip(first, second, strict=True))
    return place, slope, tuple(q / fourth for q in second)


def _on_curve(first: Sample, second: Sample, share: float) -> tuple[Vector, Vector]:
    """Place and velocity at `share` of the cubic between two samples."""
    ends = zip(first.position, second.position, zip(first.velocity, second.velocity, strict=True), strict=True)
    rows = [on_cubic(a, b, rates, second.time - first.time, share) for a, b, rates in ends]
    return tuple(place for place, _ in rows), tuple(rate for _, rate in rows)


def _between(first: Vector, second: Vector, share: float) -> Vector:
    return tuple(a + share * (b - a) for a, b in zip(first, second, strict=True))
