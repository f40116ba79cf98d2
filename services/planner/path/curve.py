"""A path without corners, by its length: a uniform cubic B-spline as cubic pieces, with derivatives by arc length.

Lengths are times at full speed: joint values are divided by the joints' speed limits, and what is left is measured as
in space, so that the length of a path is smooth and a unit of it takes about a second at least.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Tuning constants: chosen, where a line does not say measured or standard.
PARTS = 8  # of a piece, within which its length is integrated and looked up
NEWTON = 3  # steps from the look-up to the parameter; chosen: each doubles the digits of a start that has three
SMALLEST = 1e-12  # of a path's whole length: a piece that is shorter is none
CORNER = 1e-6  # between two unit tangents: beyond it the path has a corner
SLOWEST = 1e-3  # of the mean speed in the parameter: below it a piece turns on the spot
NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)
NODES, WEIGHTS = 0.5 * (NODES + 1.0), 0.5 * WEIGHTS
BLENDING = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6.0  # B-spline to powers of u


class TurnsOnTheSpot(ValueError):
    """A curve that comes to rest in its parameter where it has no corner."""


class Derivatives(NamedTuple):
    """(m, n) each: the value, and its derivatives by the length."""

    value: Array
    first: Array
    second: Array
    third: Array


def spline_rows(control: Array, rows: int) -> Array:
    """Configurations (m, n) [rad] or [m] along the uniform cubic B-spline of `control` (k, n), `rows` in each span,
    both ends included."""
    powers = _powers(control)
    u = np.linspace(0.0, 1.0, rows, endpoint=False)
    values = np.stack((np.ones_like(u), u, u * u, u**3), axis=1)
    inner = np.einsum("ru,kun->krn", values, powers).reshape(-1, control.shape[1])
    return np.vstack((control[:1], inner[1:], control[-1:]))


def smooth_runs(control: Array, scale: Array) -> list[Curve]:
    """The parts of the curve of `control` (k, n) [rad] or [m] between its corners, at which it has to stop; values are
    divided by `scale` (n,)."""
    pieces = _straightened(control / scale)
    lengths = np.linalg.norm(pieces[:, 1:].sum(axis=1), axis=1)
    pieces = pieces[lengths > SMALLEST * max(float(lengths.sum()), 1.0)]
    return [Curve(run) for run in np.split(pieces, _corners(pieces)) if len(run)]


class Curve:
    """A smooth run of cubic pieces (k, 4, n) in powers of u from 0 to 1, by its length."""

    def __init__(self, pieces: Array) -> None:
        self._pieces = pieces
        self._squares = _squared_speeds(pieces)
        starts = np.linspace(0.0, 1.0, PARTS, endpoint=False)
        self._part_u = np.tile(starts, len(pieces))
        self._part_piece = np.repeat(np.arange(len(pieces)), PARTS)
        width = np.full(len(self._part_u), 1.0 / PARTS)
        steps = self._integral(self._part_piece, self._part_u, width)
        if float(steps.min()) < SLOWEST * float(steps.mean()) / len(pieces):
            raise TurnsOnTheSpot("the curve turns on the spot")
        self._part_length = np.concatenate(([0.0], np.cumsum(steps)))
        self.length = float(self._part_length[-1])

    @property
    def knots(self) -> Array:
        """Lengths (k + 1,) [s at full speed] at which pieces begin and end."""
        return self._part_length[::PARTS]

    def at(self, lengths: Array) -> Derivatives:
        """The curve and its derivatives (m, n) at `lengths` (m,) [s at full speed] from the run's start."""
        piece, u = self._locate(np.clip(lengths, 0.0, self.length))
        return self._derivatives(piece, u)

    def cut(self, parts: int, shares: Array) -> tuple[Array, Derivatives]:
        """Lengths (k * parts,) [s at full speed] of the pieces' even parts, `parts` a divisor of PARTS, and the curve
        inside them.

        The curve is evaluated where the parameter is at `shares` (m,), 0 to 1, of each part; one row for each of them.
        """
        lengths = np.diff(self._part_length[:: PARTS // parts])
        u = ((np.arange(parts)[:, None] + shares) / parts).reshape(-1)
        count = len(self._pieces)
        return lengths, self._derivatives(np.repeat(np.arange(count), len(u)), np.tile(u, count))

    def _locate(self, lengths: Array) -> tuple[Indices, Array]:
        """Piece and parameter, by Newton from the table."""
        row = np.clip(np.searchsorted(self._part_length, lengths, side="right") - 1, 0, len(self._part_u) - 1)
        piece, begin = self._part_piece[row], self._part_u[row]
        wanted = lengths - self._part_length[row]
        width = wanted / (self._part_length[row + 1] - self._part_length[row]) / PARTS
        for _ in range(NEWTON):
            missing = wanted - self._integral(piece, begin, width)
            width = np.clip(width + missing / self._speed(piece, begin + width), 0.0, 1.0 / PARTS)
        return piece, begin + width

    def _integral(self, piece: Indices, begin: Array, width: Array) -> Array:
        """(m,) lengths from `begin` over `width` of the parameter."""
        at = begin[:, None] + width[:, None] * NODES
        speeds = self._speed(np.repeat(piece, len(NODES)), at.reshape(-1)).reshape(at.shape)
        result: Array = (speeds @ WEIGHTS) * width
        return result

    def _speed(self, piece: Indices, u: Array) -> Array:
        s0, s1, s2, s3, s4 = self._squares[piece].T
        return np.asarray(np.sqrt(np.maximum(s0 + u * (s1 + u * (s2 + u * (s3 + u * s4))), 0.0)))

    def _derivatives(self, piece: Indices, u: Array) -> Derivatives:
        """By the chain rule; r is the speed in the parameter, a dash after it a derivative by the parameter."""
        c0, c1, c2, c3 = self._pieces[piece].transpose(1, 0, 2)
        u = u[:, None]
        value = c0 + u * (c1 + u * (c2 + u * c3))
        y1, y2, y3 = c1 + u * (2.0 * c2 + u * 3.0 * c3), 2.0 * c2 + u * 6.0 * c3, 6.0 * c3
        r = np.linalg.norm(y1, axis=1)[:, None]
        r1 = (y1 * y2).sum(axis=1)[:, None] / r
        r2 = ((y2 * y2 + y1 * y3).sum(axis=1)[:, None] - r1 * r1) / r
        first = y1 / r
        second = (y2 - first * r1) / r**2
        third = ((y3 - second * r * r1 - first * r2) / r**2 - 2.0 * r1 * second / r) / r
        return Derivatives(value, first, second, third)


def _powers(control: Array) -> Array:
    """(k - 3, 4, n) each span in powers of its parameter."""
    windows = np.stack([control[i : len(control) - 3 + i] for i in range(4)], axis=1)
    powers: Array = np.einsum("uc,kcn->kun", BLENDING, windows)
    return powers


def _squared_speeds(pieces: Array) -> Array:
    """(k, 5) the square of each piece's speed in its parameter, in powers of that."""
    d0, d1, d2 = pieces[:, 1], 2.0 * pieces[:, 2], 3.0 * pieces[:, 3]
    products = (d0 * d0, 2.0 * d0 * d1, d1 * d1 + 2.0 * d0 * d2, 2.0 * d1 * d2, d2 * d2)
    return np.stack([product.sum(axis=1) for product in products], axis=1)


def _straightened(control: Array) -> Array:
    """As `_powers`; a span that rests at one of its ends is a straight line, so it is given an even speed."""
    pieces = _powers(control)
    same = (np.diff(control, axis=0) == 0.0).all(axis=1)
    resting = (same[:-2] & same[1:-1]) | (same[1:-1] & same[2:])
    ends = pieces[resting].sum(axis=1)
    pieces[resting, 1] = ends - pieces[resting, 0]
    pieces[resting, 2:] = 0.0
    return pieces


def _corners(pieces: Array) -> Indices:
    """The numbers of the pieces that begin in another direction than the one before ends in."""
    leaving, coming = pieces[:-1, 1] + 2.0 * pieces[:-1, 2] + 3.0 * pieces[:-1, 3], pieces[1:, 1]
    one, other = (rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (leaving, coming))
    return np.flatnonzero(np.linalg.norm(one - other, axis=1) > CORNER) + 1
