"""Knots of a path by stream time, with the cubic Hermite between them, as the device plays them."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from typing import NamedTuple

from gemelo.services.stepper_gateway.motion.knots import Knot, StepKnot


class PathPoint(NamedTuple):
    """The commanded path at one instant, in steps with their fraction."""

    steps: tuple[float, ...]
    rate: tuple[float, ...]  # [steps/s]


class PathVersion:
    """What a chunk that replaces the path's end has made of it, from its first knot on; or all of a path so far."""

    def __init__(self, seq: int, ends: bool = False) -> None:
        """`seq` of its first chunk; `ends` where the stream ends with it."""
        self.seq, self.ends = seq, ends
        self.times: list[int] = []  # [us]
        self.steps: list[StepKnot] = []
        self.knots: list[Knot] = []
        self._braking: list[float] = []  # [s] from each knot to rest

    def append(self, time_us: int, steps: StepKnot, knot: Knot, braking: float) -> None:
        """`braking` [s] is how long the arm takes from the knot to rest."""
        self.times.append(time_us)
        self.steps.append(steps)
        self.knots.append(knot)
        self._braking.append(braking)

    def span(self, from_us: int, to_us: int) -> slice:
        """The knots from the one at or before `from_us` to the one at or before `to_us`."""
        return slice(max(0, bisect_right(self.times, from_us) - 1), bisect_right(self.times, to_us))

    def next_after(self, time_us: int) -> int:
        """Index of the first knot at `time_us` [us] or later; of the last one, if there is none."""
        return min(bisect_left(self.times, time_us), len(self.times) - 1)

    def longest_braking(self, from_us: int, to_us: int) -> float:
        """[s] the longest that braking from one of its knots of that time to rest takes; 0 for none."""
        return max(self._braking[self.span(from_us, to_us)], default=0.0)

    def at(self, time_us: int) -> PathPoint:
        """The commanded path [steps] at `time_us` [us] of the stream, held at its ends."""
        index = bisect_right(self.times, time_us) - 1
        if index < 0:
            return _rest(self.steps[0])
        if index >= len(self.times) - 1:
            return _rest(self.steps[-1])
        span = self.times[index + 1] - self.times[index]
        return _hermite(self.steps[index], self.steps[index + 1], (time_us - self.times[index]) / span, span * 1e-6)

    def prune(self, played_us: int, kept: int) -> None:
        """Forget all but `kept` knots of what was played."""
        gone = max(0, bisect_right(self.times, played_us) - kept)
        del self.times[:gone], self.steps[:gone], self.knots[:gone], self._braking[:gone]


def _rest(knot: StepKnot) -> PathPoint:
    return PathPoint(tuple(p / 256.0 for p in knot.position), (0.0,) * len(knot.position))


def _hermite(first: StepKnot, second: StepKnot, u: float, span: float) -> PathPoint:
    """`u` in [0, 1] of the segment, which lasts `span` seconds."""
    h00, h10 = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u * (1.0 - u) ** 2
    h01, h11 = u * u * (3.0 - 2.0 * u), u * u * (u - 1.0)
    d00, d10, d11 = 6.0 * u * (u - 1.0), (1.0 - u) * (1.0 - 3.0 * u), u * (3.0 * u - 2.0)
    steps, rate = [], []
    for p0, v0, p1, v1 in zip(first.position, first.velocity, second.position, second.velocity, strict=True):
        m0, m1 = v0 * span, v1 * span
        steps.append((h00 * p0 + h10 * m0 + h01 * p1 + h11 * m1) / 256.0)
        rate.append((d00 * (p0 - p1) + d10 * m0 + d11 * m1) / span / 256.0)
    return PathPoint(tuple(steps), tuple(rate))
