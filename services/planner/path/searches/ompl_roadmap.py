"""The search over a roadmap that OMPL grows, PRM: its shortest path, and from the start and to a goal by its nearest
places (Dijkstra 1959)."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.ompl_problem import OmplProblem, configuration_of
from gemelo.services.planner.path.path import PathNotFound, Sought
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import SearchFailure

Array = NDArray[np.float64]
Neighbours = dict[int, list[tuple[int, float]]]

# Tuning constants: chosen, where a line does not say measured or standard.
BATCH = 60  # "are we done?" while the roadmap grows, until it is looked at
TRIED = 10  # nearest places to which an end is joined; chosen: each costs the check of a line


def corners(sought: Sought, _planner_id: str, deadline: Deadline) -> Array:
    """Corners (m, n) [rad] or [m] of the path on a roadmap; raises `PathNotFound`. OMPL grows the roadmap only: its
    `solve` waits for a thread that waits for Python, for ever."""
    from ompl import geometric  # slow to load

    problem = OmplProblem(sought)
    planner = geometric.PRM(problem.information)
    planner.setProblemDefinition(problem.definition)
    planner.setup()
    is_late, is_line_free = problem.late(deadline), sought.validity.is_line_free
    while not is_late():
        planner.growRoadmapPtc(problem.base.PlannerTerminationCondition(_after(BATCH, is_late)))
        if is_late():
            break
        data = problem.base.PlannerData(problem.information)
        planner.getPlannerData(data)
        places = [configuration_of(data.getVertex(row).getState(), problem.scale) for row in range(data.numVertices())]
        edges = [(row, int(other)) for row in range(len(places)) for other in data.getEdges(row)]
        found = shortest_path(sought.start, sought.goals, np.array(places), edges, problem.scale, is_line_free)
        if found is not None:
            return found
    raise PathNotFound(SearchFailure.TIMED_OUT)


def _after(count: int, is_over: Callable[[], bool]) -> Callable[[], bool]:
    left = count

    def is_done() -> bool:
        nonlocal left
        left -= 1
        return left < 0 or is_over()

    return is_done


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
