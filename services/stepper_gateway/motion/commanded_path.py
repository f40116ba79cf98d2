"""The path that was sent along one stream: the command at any played instant, exactly."""

from __future__ import annotations

from bisect import bisect_right
from typing import NamedTuple

from gemelo.services.stepper_gateway.motion.knots import Knot, StepKnot

KEPT = 256  # knots behind the played one that are kept; chosen: 5 s, longer than a state is under way
PRUNED_AT = 1024  # how many may gather before pruning; chosen: so pruning costs little for each knot


class PathPoint(NamedTuple):
    """The commanded path at one instant, in steps with their fraction."""

    steps: tuple[float, ...]
    rate: tuple[float, ...]  # [steps/s]


class CommandedPath:
    """The knots of a stream by stream time; cubic Hermite between them, as the device plays them."""

    def __init__(self) -> None:
        self._times: list[int] = []  # [us]
        self._steps: list[StepKnot] = []
        self._knots: list[Knot] = []
        self._braking: list[float] = []  # [s] from each knot to rest

    def append(self, time_us: int, steps: StepKnot, knot: Knot, braking: float) -> None:
        """`braking` [s] is how long the arm takes from the knot to rest."""
        self._times.append(time_us)
        self._steps.append(steps)
        self._knots.append(knot)
        self._braking.append(braking)

    @property
    def end_us(self) -> int:
        return self._times[-1] if self._times else 0

    @property
    def last(self) -> Knot:
        return self._knots[-1]

    @property
    def last_steps(self) -> StepKnot:
        return self._steps[-1]

    def knots_between(self, from_us: int, to_us: int) -> list[Knot]:
        """The knots from the one at or before `from_us` to the one at or before `to_us`."""
        first = max(0, bisect_right(self._times, from_us) - 1)
        return self._knots[first : bisect_right(self._times, to_us)]

    def count_between(self, from_us: int, to_us: int) -> int:
        """How many `knots_between` has."""
        return bisect_right(self._times, to_us) - max(0, bisect_right(self._times, from_us) - 1)

    def longest_braking(self, from_us: int, to_us: int) -> float:
        """[s] the longest that braking from one of `knots_between` to rest takes; 0 for none."""
        first = max(0, bisect_right(self._times, from_us) - 1)
        return max(self._braking[first : bisect_right(self._times, to_us)], default=0.0)

    def upcoming(self, from_us: int) -> list[tuple[int, Knot]]:
        """Stream times [us] and knots, from the one at or before `from_us` to the last."""
        first = max(0, bisect_right(self._times, from_us) - 1)
        return list(zip(self._times[first:], self._knots[first:], strict=True))

    def at(self, time_us: int) -> PathPoint:
        """The commanded path [steps] at `time_us` [us] of the stream, held at its ends."""
        index = bisect_right(self._times, time_us) - 1
        if index < 0:
            return _rest(self._steps[0])
        if index >= len(self._times) - 1:
            return _rest(self._steps[-1])
        span = self._times[index + 1] - self._times[index]
        return _hermite(self._steps[index], self._steps[index + 1], (time_us - self._times[index]) / span, span * 1e-6)

    def prune(self, played_us: int) -> None:
        """Forget what was played long ago."""
        if len(self._times) > PRUNED_AT:
            gone = max(0, bisect_right(self._times, played_us) - KEPT)
            del self._times[:gone], self._steps[:gone], self._knots[:gone], self._braking[:gone]


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
