"""The shortest path over a roadmap, and from the start and to a goal by its nearest places (Dijkstra 1959)."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Neighbours = dict[int, list[tuple[int, float]]]

# Tuning constants: chosen, where a line does not say measured or standard.
TRIED = 10  # nearest places to which an end is joined; chosen: each costs the check of a line


def shortest_path(
    start: Array,
    goals: Array,
    places: Array,
    edges: Iterable[tuple[int, int]],
    scale: Array,
    is_line_free: Callable[[Array, Array], bool],
) -> Array | None:
    """Corners (m, n) [rad] or [m] from `start` (n,) to one of `goals` (k, n), or None; distances are divided by `scale`
    (n,)."""
    if len(places) == 0:
        return None
    rows = np.vstack((places, start, goals))
    neighbours: Neighbours = {row: [] for row in range(len(rows))}
    for first, second in edges:
        _join(neighbours, rows, first, second, scale)
    for end in range(len(places), len(rows)):
        distances = np.linalg.norm((places - rows[end]) / scale, axis=1)
        for near in np.argsort(distances, kind="stable")[:TRIED].tolist():
            if is_line_free(rows[end], rows[near]):
                _join(neighbours, rows, end, near, scale)
    found = _dijkstra(neighbours, len(places), set(range(len(places) + 1, len(rows))))
    return None if found is None else rows[found]


def _join(neighbours: Neighbours, rows: Array, first: int, second: int, scale: Array) -> None:
    length = float(np.linalg.norm((rows[first] - rows[second]) / scale))
    neighbours[first].append((second, length))
    neighbours[second].append((first, length))


def _dijkstra(neighbours: Neighbours, start: int, goals: set[int]) -> list[int] | None:
    came_from: dict[int, int] = {}
    waiting = [(0.0, start, start)]
    while waiting:
        length, place, before = heapq.heappop(waiting)
        if place in came_from:
            continue
        came_from[place] = before
        if place in goals:
            return _traced(came_from, place, start)
        for other, step in neighbours[place]:
            if other not in came_from:
                heapq.heappush(waiting, (length + step, other, place))
    return None


def _traced(came_from: dict[int, int], place: int, start: int) -> list[int]:
    path = [place]
    while path[-1] != start:
        path.append(came_from[path[-1]])
    return path[::-1]
