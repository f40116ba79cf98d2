"""The stop of a path where the gateway falls silent, in distance and time: as firmware/core does it, by knots.

With the time scale s and y = s^2 the device plays on as far as its queue's ceilings let it (ceiling.cpp) until it
misses the heartbeat, and then lowers s as fast as its joints' accelerations allow (time_scale.cpp). Over one segment of
path time dt, y is taken as straight, so it lasts 2 dt / (sqrt(y0) + sqrt(y1)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

MARGIN = 1.02 * 17.0 / 16.0  # of an acceleration limit: what the device is told, and adds; standard: firmware/core
SLOWEST = 1e-6  # of y: below it the path stands; chosen: 1/1000 of its speed
CARE, LEAST = 1.015, 0.0001  # chosen: factor and [m] for what straight pieces of y and chords of the way leave out


class Segment(NamedTuple):
    """The path from one knot to the next; speeds and limits per joint, in its unit."""

    dt: float  # [s] of path time
    length: float  # [m] of the tool's path
    speeds: tuple[float, ...]  # the larger one at the two knots, without sign
    gains: tuple[float, ...]  # by which the speed rises over the segment; a reversal brakes first


class StoppingPath(NamedTuple):
    """Until the path stands."""

    distance: float  # [m] of the tool's path
    duration: float  # [s]


def segment(dt: float, length: float, first: Sequence[float], second: Sequence[float]) -> Segment:
    """Between knots with these velocities, `dt` [s] and `length` [m] apart; as `drift_between` of segment.cpp."""
    speeds, gains = [], []
    for v0, v1 in zip(first, second, strict=True):
        a, b = abs(v0), abs(v1)
        speeds.append(max(a, b))
        gains.append(-(a + b) if v0 * v1 < 0.0 else b - a)
    return Segment(dt, length, tuple(speeds), tuple(gains))


def stop_on(
    path: Sequence[Segment], limits: Sequence[float], y: float, top: float, reaction: float, *, ends: bool
) -> StoppingPath:
    """The stop on `path`, which begins where the arm is at y = s^2.

    `limits`: the joints' accelerations. Until `reaction` [s] have passed s may rise to `top`. `ends`: the path ends at
    rest; otherwise more was to come, and the device stands on the last knot.
    """
    able = [MARGIN * limit for limit in limits]
    ceilings = _ceilings(path, able, 1.0 if ends else 0.0)
    distance = time = 0.0
    for part, (here, ceiling) in zip(path, pairwise(ceilings), strict=True):
        free = max(0.0, reaction - time)
        start = min(max(y, top * top), here) if free > 0.0 else y
        played = _segment_time(part.dt, start, min(start, ceiling)) if free > 0.0 else 0.0
        share = min(1.0, free / played) if played > 0.0 else 0.0
        y = min(start, ceiling)  # at the end of the segment, if it is played on
        time, distance = time + share * played, distance + share * part.length
        if share < 1.0:
            end = min(y, start - (1.0 - share) * _fall(part, able, start))
            reached = 1.0 if end > SLOWEST else _share_to_rest(start, end)
            distance += (1.0 - share) * reached * part.length
            time += _segment_time((1.0 - share) * reached * part.dt, start, max(end, 0.0))
            y = end
        if y <= SLOWEST:
            break
    return StoppingPath(CARE * distance + LEAST if distance > 0.0 else 0.0, time)


def _ceilings(path: Sequence[Segment], able: Sequence[float], last: float) -> list[float]:
    """The highest y before every segment and after the last, from which the device can stop at the last knot."""
    found = [last]
    for part in reversed(path):
        after, twice, lowest = found[-1], 2.0 * part.dt, 1.0
        for speed, gain, limit in zip(part.speeds, part.gains, able, strict=True):
            if speed > 0.0:
                own = -2.0 * gain if gain < 0.0 else 0.0
                bound = (after * speed + twice * limit) / (speed + own)
                if bound < lowest:
                    lowest = bound
        found.append(lowest)
    return found[::-1]


def _fall(part: Segment, able: Sequence[float], y: float) -> float:
    """By how much y falls over the whole segment at the joints' limits: dy = 2 dt (A - own braking y) / v."""
    least = math.inf
    for speed, gain, limit in zip(part.speeds, part.gains, able, strict=True):
        if speed > 0.0:
            room = limit - (-gain / part.dt) * y if gain < 0.0 else limit
            fall = 2.0 * part.dt * room / speed if room > 0.0 else 0.0
            if fall < least:
                least = fall
    return least


def _segment_time(dt: float, y0: float, y1: float) -> float:
    """[s] that a path time of `dt` takes; 0 for a segment that is left at once."""
    total = (math.sqrt(y0) if y0 > 0.0 else 0.0) + (math.sqrt(y1) if y1 > 0.0 else 0.0)
    return 2.0 * dt / total if total > 0.0 else 0.0


def _share_to_rest(start: float, end: float) -> float:
    """The share of a segment at whose end y would be `end` <= 0, after which it is 0."""
    return min(1.0, start / (start - end)) if start > end else 1.0
