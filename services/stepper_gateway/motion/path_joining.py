"""Bridges: from any state of motion onto a path, continuous in position, velocity and acceleration."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from services.stepper_gateway.motion.knots import Knot
from services.stepper_gateway.motion.limits import Limits
from services.stepper_gateway.motion.paths import ProfilePath, TimedPath, profile

GRID = 0.02  # [s] between the times at which the path may be met; chosen: one for each knot
GRID_POINTS = 150  # at most so many are tried, coarser on long paths; chosen: bounds the time of a step of the loop
SAMPLE = 0.01  # [s] between the instants at which a join is checked; chosen: two for each knot

Within = Callable[[Knot], bool]


class JoinedPath:
    """The join until `meets`, then the path itself."""

    def __init__(self, join: ProfilePath, path: TimedPath, meets: float) -> None:
        self._bridge = join
        self._path = path
        self.meets = meets  # [s]
        self.duration = max(path.duration, meets)

    def at(self, t: float) -> Knot:
        """The knot at `t` [s]."""
        return self._bridge.at(t) if t < self.meets else self._path.at(t)


def join_path(start: Knot, path: TimedPath, limits: Limits, within: Within) -> TimedPath | None:
    """`path`, joined from `start` as early as the limits allow; else straight to its end; None if that leaves `within`.

    The join ends at the smallest time of the grid at which the state-to-state minimum is no longer than that
    time, stretched to exactly it.
    """
    for meets in _grid(path.duration):
        target = path.at(meets)
        if (fastest := profile(start, target, limits)) is None or fastest.duration > meets:
            continue
        joined = profile(start, target, limits, meets)
        if joined is not None and _stays(joined, within):
            return JoinedPath(joined, path, meets)
    direct = profile(start, Knot.at_rest(path.at(path.duration).position), limits)
    return direct if direct is not None and _stays(direct, within) else None


def _grid(duration: float) -> Iterator[float]:
    count = max(1, min(GRID_POINTS, int(duration / GRID)))
    return (duration * (i + 1) / count for i in range(count))


def _stays(path: ProfilePath, within: Within) -> bool:
    count = int(path.duration / SAMPLE) + 1
    return all(within(path.at(path.duration * i / count)) for i in range(count + 1))
