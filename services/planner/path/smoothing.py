"""A polyline made shorter by straight cuts, and its corners round: what the native planner does for its own ways."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gemelo.services.planner.path.validity import ValidityChecker
from gemelo.services.planner.request.deadline import Deadline

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
CUTS = 60  # tried; each costs the check of a line; chosen: later ones hardly shorten
FRUITLESS = 15  # of them in a row are enough; chosen: a quarter of all
WIDEST = 0.5  # share of an edge that its corner may be rounded over
LEAST = 1.0 / 64.0  # chosen: a corner that does not fit after six halvings stays a stop
SHARED = 2  # control points from one corner to the next, where these share the one between them


def shorten(corners: Array, validity: ValidityChecker, seed: int, deadline: Deadline) -> Array:
    """The polyline (m, n) [rad] or [m] with straight cuts between random places on it, until the deadline or until cuts
    fail.

    At last the corners that are not needed are removed: two that nearly coincide would slow the arm down.
    """
    random = np.random.default_rng(seed)
    fruitless = 0
    for _ in range(CUTS):
        if len(corners) <= 2 or fruitless >= FRUITLESS or deadline.has_passed():
            break
        low, high = sorted(random.uniform(0.0, len(corners) - 1.0, 2).tolist())
        cut = _cut(corners, low, high, validity)
        fruitless = fruitless + 1 if cut is None else 0
        corners = corners if cut is None else cut
    return _needed(corners, validity, deadline)


@dataclass(frozen=True)
class Rounded:
    """A polyline, and how far each of its corners is to be cut."""

    corners: Array  # (m, n) [rad] or [m]
    shares: Array  # (m,) of its edges; 0 at both ends
    unknown: frozenset[int] = frozenset()  # corners of which it is not known that the curve is free there

    @property
    def turned(self) -> Rounded:
        """From its end to its beginning."""
        last = len(self.corners) - 1
        return Rounded(self.corners[::-1], self.shares[::-1], frozenset(last - corner for corner in self.unknown))

    def continued(self, start: Array, validity: ValidityChecker) -> Rounded:
        """From `start` (n,) [rad] or [m] straight to its first corner, or past it to the second where that is free."""
        if len(self.corners) > 1 and validity.is_line_free(start, self.corners[1]):
            return Rounded(np.vstack((start, self.corners[1:])), self.shares, self._inner(self.unknown | {1}))
        shares = np.concatenate(([0.0, WIDEST], self.shares[1:]))
        shifted = frozenset(corner + 1 for corner in self.unknown) | {1, 2}  # which share the edge between them
        longer = Rounded(np.vstack((start, self.corners)), shares)
        return Rounded(longer.corners, shares, longer._inner(shifted))

    def _inner(self, numbers: frozenset[int]) -> frozenset[int]:
        return numbers & frozenset(range(1, len(self.corners) - 1))


def smooth(corners: Array, validity: ValidityChecker, deadline: Deadline) -> Array:
    """`smooth_unknown` of the polyline `corners` (m, n) [rad] or [m] of which nothing is known."""
    shares = np.full(len(corners), WIDEST)
    shares[[0, -1]] = 0.0
    return smooth_unknown(Rounded(corners, shares, frozenset(range(1, len(corners) - 1))), validity, deadline)


def smooth_unknown(path: Rounded, validity: ValidityChecker, deadline: Deadline) -> Array:
    """Control points (k, n) [rad] or [m] of a uniform cubic B-spline along the polyline of `path`, free as a whole;
    looked at where that is not known.

    Every corner keeps its own control point, with one before and one after it on its edges; where the curve touches,
    they come nearer to the corner, and at last the curve goes to the corner itself and stops there.
    """
    corners, shares = path.corners, path.shares.copy()
    waiting = {corner for corner in path.unknown if shares[corner] > 0.0}
    control, places = _lay(corners, shares)
    while waiting and not deadline.has_passed():
        touching = {corner for corner in sorted(waiting) if not validity.is_curve_free(control[_bent(places, corner)])}
        for corner in touching:
            shares[corner] = 0.5 * shares[corner] if shares[corner] > LEAST else 0.0
        near = touching | {corner + side for corner in touching for side in (-1, 1)}  # they share its edges
        waiting = {corner for corner in near if shares[corner] > 0.0}
        control, places = _lay(corners, shares)
    return stopping(corners) if waiting else control


def stopping(corners: Array) -> Array:
    """Control points (3 m, n) [rad] or [m] of the curve that stops at every corner (m, n): the polyline itself."""
    return np.repeat(corners, 3, axis=0)


def _needed(corners: Array, validity: ValidityChecker, deadline: Deadline) -> Array:
    """The polyline without each corner that a straight line may pass by."""
    kept = [corners[0]]
    for corner, after in pairwise(corners[1:]):
        if deadline.has_passed() or not validity.is_line_free(kept[-1], after):
            kept.append(corner)
    return np.array([*kept, corners[-1]])


def _cut(corners: Array, low: float, high: float, validity: ValidityChecker) -> Array | None:
    """The polyline that goes straight from one place on it to another; None where it is not free or no shorter."""
    first, last = int(low), int(high)
    if first == last:
        return None
    begin = corners[first] + (low - first) * (corners[first + 1] - corners[first])
    end = corners[last] + (high - last) * (corners[min(last + 1, len(corners) - 1)] - corners[last])
    if not validity.is_line_free(begin, end):
        return None
    rows = np.vstack((corners[: first + 1], begin, end, corners[last + 1 :]))
    moving = np.concatenate(([True], np.any(np.abs(np.diff(rows, axis=0)) > 1e-9, axis=1)))
    moving[-1] = True
    return np.asarray(rows[moving])


def _bent(places: list[int], corner: int) -> slice:
    """The control points of the spans that bend at this corner; others that it has a part in lie on one edge."""
    before, here, after = places[corner - 1 : corner + 2]
    shares_before, shares_after = here - before == SHARED, after - here == SHARED and corner + 2 < len(places)
    return slice(here - (3 if shares_before else 2), here + (4 if shares_after else 3))


def _lay(corners: Array, shares: Array) -> tuple[Array, list[int]]:
    """The control points, and the place of each corner's own among them."""
    rows, places = [corners[0]] * 3, [0]
    for index in range(1, len(corners) - 1):
        before, corner, after = corners[index - 1 : index + 2]
        share = shares[index]
        is_shared = share == WIDEST and shares[index - 1] == WIDEST and index > 1
        if not is_shared:
            rows.append(corner + share * (before - corner))
        places.append(len(rows))
        rows += [corner, corner + share * (after - corner)]
    places.append(len(rows))
    return np.array([*rows, *[corners[-1]] * 3]), places
