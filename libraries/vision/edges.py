"""Edges between two brightnesses, located to a hundredth of a pixel: sampled across, fitted along.

A profile across a blurred step holds the same area as a sharp one, so the area says where the step is; unlike the
steepest point or a corner's saddle, that does not move with the blur.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Brightness = NDArray[np.float64] | NDArray[np.uint8]

SAMPLES = 11  # of a profile
REJECTED_AT = 3.0  # robust standard deviations from the line
LEVEL_SHARE = 0.25  # of a profile at either end gives its brightness there
START_SPREAD, LEAST_SPREAD = 0.75, 0.3  # [px] of a step in a sharp image
STEP_ROUNDS = 5
STEP_SETTLED = 5e-3  # [px] of a round's shift: what is left is far less, and the matched filter takes it off
LARGEST_CHANGE = np.array([np.inf, np.inf, 0.5, 0.3])  # of a step's levels, shift [px] and spread [px] in one round
ALONG = np.linspace(0.0, 1.0, SAMPLES)  # of a profile
ROOT_TAU = np.sqrt(2.0 * np.pi)
UNIT = np.arange(4)
LEAST_NOISE = 0.02  # [px] what lens, sensor and paper add to the scatter of an edge


@dataclass(frozen=True)
class Lines:
    """Straight edges in a plane of pixels: the points x with normals[i] . x = offsets[i]."""

    normals: Array  # (edges, 2)
    offsets: Array  # (edges,) [px]
    scatter: Array  # (edges,) [px] standard deviation of the points from their line
    kept: Array  # (edges,) share of the points that agree

    def crossings(self, first: Index, second: Index) -> Array:
        """Where lines `first` (n,) and `second` (n,) meet: (n, 2) [px], not finite for parallel ones."""
        a, b = self.normals[first], self.normals[second]
        divisor = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            x = (self.offsets[first] * b[:, 1] - self.offsets[second] * a[:, 1]) / divisor
            y = (self.offsets[second] * a[:, 0] - self.offsets[first] * b[:, 0]) / divisor
        return np.stack((x, y), axis=1)


def sample(image: Brightness, points: Array) -> Array:
    """The brightness at points (..., 2) [px], linear between pixels; beyond the border that of the border."""
    height, width = image.shape
    x = np.minimum(np.maximum(points[..., 0], 0.0), width - 1.001)
    y = np.minimum(np.maximum(points[..., 1], 0.0), height - 1.001)
    left, top = x.astype(np.intp), y.astype(np.intp)
    u, v = x - left, y - top
    above = image[top, left] * (1.0 - u) + image[top, left + 1] * u
    below = image[top + 1, left] * (1.0 - u) + image[top + 1, left + 1] * u
    return np.asarray(above * (1.0 - v) + below * v)


@dataclass(frozen=True)
class Steps:
    """The measured steps of several edges, m to each."""

    offsets: Array  # (edges, m) [px] along the normal from where it was sampled
    contrast: Array  # (edges,) brightness at the far end minus that at the near end
    spread: Array  # (edges,) [px]


# An image, points (edges, m, 2), normals (edges, 2) and the reach (edges, 2) before and behind them.
Measure = Callable[[Brightness, Array, Array, Array], Steps]


def find_steps(image: Brightness, points: Array, normals: Array, reach: Array) -> Steps:
    """Steps across points (edges, m, 2) along `normals` (edges, 2) within `reach` (edges, 2) [px] before and behind, by
    area: for points that are some pixels off."""
    along, values = _profiles(image, points, normals, reach)
    ends = max(2, int(LEVEL_SHARE * SAMPLES / 2))
    near = middles(values[:, :, :ends].reshape(len(values), -1))
    far = middles(values[:, :, -ends:].reshape(len(values), -1))
    risen = (values - near[:, None, None]) / _divisor(far - near)[:, None, None]
    area = (risen.sum(axis=2) - (risen[:, :, 0] + risen[:, :, -1]) / 2.0) * (along[:, 1:2] - along[:, :1])
    return Steps(reach[:, 1:2] - area, far - near, np.full(len(points), START_SPREAD))


def measure_steps(image: Brightness, points: Array, normals: Array, reach: Array) -> Steps:
    """As `find_steps`, for `points` (edges, m, 2), `normals` and `reach` (edges, 2) [px] within half a pixel of the
    edge: a blurred step is fitted to the mean profile of each edge, and each profile is shifted against it by least
    squares (a matched filter): little depends on what lies farther off."""
    along, values = _profiles(image, points, normals, reach)
    fits = _fit_steps(values.mean(axis=1), along)
    near, contrast, shift, spread = (fits[:, index, None] for index in range(4))
    place = (along - shift) / spread
    risen, bell = normal_distribution(place)
    slope = bell * (-contrast / spread)
    left = values - (near + contrast * risen)[:, None, :]
    weight = slope / np.maximum(np.sum(slope**2, axis=1, keepdims=True), 1e-9)
    return Steps(shift + np.einsum("emk,ek->em", left, weight), fits[:, 1], fits[:, 3])


def _profiles(image: Brightness, points: Array, normals: Array, reach: Array) -> tuple[Array, Array]:
    """Distances (edges, k) [px] from the points and the brightness (edges, m, k) there."""
    along = -reach[:, :1] + ALONG * reach.sum(axis=1, keepdims=True)
    return along, sample(image, points[:, :, None, :] + along[:, None, :, None] * normals[:, None, None, :])


def _divisor(contrast: Array) -> Array:
    return np.asarray(np.where(np.abs(contrast) < 1.0, np.inf, contrast), dtype=np.float64)


def _fit_steps(means: Array, along: Array) -> Array:
    """Brightness at the near end, contrast, shift [px] and spread [px] (edges, 4) of profiles (edges, k) at
    distances `along` (edges, k), by Gauss and Newton."""
    near, far = means[:, :2].mean(axis=1), means[:, -2:].mean(axis=1)
    fits = np.stack((near, far - near, np.zeros(len(means)), np.full(len(means), START_SPREAD)), axis=1)
    slope = np.ones((len(means), 4, means.shape[1]))
    least = np.stack((along[:, 0] / 2.0, np.full(len(along), LEAST_SPREAD)), axis=1)  # of shift and spread
    most = np.stack((along[:, -1] / 2.0, along[:, -1]), axis=1)
    for _ in range(STEP_ROUNDS):
        contrast, spread = fits[:, 1:2], fits[:, 3:4]
        place = (along - fits[:, 2:3]) / spread
        risen, bell = normal_distribution(place)
        by_shift = bell * (-contrast / spread)
        slope[:, 1], slope[:, 2], slope[:, 3] = risen, by_shift, by_shift * place
        normal = slope @ slope.transpose(0, 2, 1)
        normal[:, UNIT, UNIT] *= 1.0 + 1e-9
        left = means - fits[:, :1] - contrast * risen
        change = np.linalg.solve(normal, slope @ left[..., None])[..., 0]
        fits += np.minimum(np.maximum(change, -LARGEST_CHANGE), LARGEST_CHANGE)
        np.minimum(np.maximum(fits[:, 2:], least, out=fits[:, 2:]), most, out=fits[:, 2:])
        if np.abs(change[:, 2]).max() < STEP_SETTLED:
            break
    return np.asarray(fits)


def normal_distribution(x: Array) -> tuple[Array, Array]:
    """The normal distribution function of `x`, dimensionless, to 1e-7 (Abramowitz and Stegun 26.2.17), and its
    density."""
    density = np.exp(x * x * -0.5)
    density *= 1.0 / ROOT_TAU
    t = 1.0 / (1.0 + 0.2316419 * np.abs(x))
    tail = t * 1.330274429
    for factor in (-1.821255978, 1.781477937, -0.356563782, 0.319381530):
        tail += factor
        tail *= t
    tail *= density
    return np.asarray(np.where(x >= 0.0, 1.0 - tail, tail), dtype=np.float64), density


def middles(values: Array) -> Array:
    """(n,) the median of each row (n, m): of an even number the upper one of both in the middle."""
    half = values.shape[1] // 2
    return np.asarray(np.partition(values, half, axis=1)[:, half])


def fit_lines(points: Array) -> Lines:
    """The lines through points (edges, m, 2), each without those of its points that stand off."""
    weights = np.ones(points.shape[:2])
    for is_last in (False, False, True):
        normals, offsets = _least_squares_lines(points, weights)
        away = np.einsum("emk,ek->em", points, normals) - offsets[:, None]
        if not is_last:
            apart = np.abs(away - middles(away)[:, None])
            scatter = np.maximum(1.4826 * middles(apart), LEAST_NOISE)
            weights = (apart <= REJECTED_AT * scatter[:, None]).astype(float)
    scatter = np.sqrt(np.sum(weights * away**2, axis=1) / weights.sum(axis=1))
    return Lines(normals, offsets, scatter, weights.mean(axis=1))


def _least_squares_lines(points: Array, weights: Array) -> tuple[Array, Array]:
    """Normals (edges, 2) and offsets (edges,) of the lines of least squared distance."""
    total = weights.sum(axis=1)
    centre = np.einsum("em,emk->ek", weights, points) / total[:, None]
    away = points - centre[:, None, :]
    spread = np.einsum("em,emi,emj->eij", weights, away, away)
    angle = 0.5 * np.arctan2(2.0 * spread[:, 0, 1], spread[:, 0, 0] - spread[:, 1, 1]) + np.pi / 2.0
    normals = np.stack((np.cos(angle), np.sin(angle)), axis=1)
    return normals, np.einsum("ek,ek->e", normals, centre)
