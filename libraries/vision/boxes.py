"""Boxes and coloured things on a known plane: the silhouette of a box of known size is fitted in x, y and turn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.edges import LEAST_NOISE, Index, Measure, find_steps, measure_steps, middles
from gemelo.libraries.vision.rigid import Array, apply, rigid, solved
from gemelo.libraries.vision.tag_pose import flat, on_plane
from gemelo.libraries.vision.windows import Mask, Window, regions_of, windows_around

ColourImage = NDArray[np.uint8]

LEAST_COLOUR = 40.0  # grey levels between the strongest and the weakest of a colour's red, green and blue
MASK_SHARE = 0.35  # of the colour's own strength makes a pixel part of a thing
LEAST_AREA = 60  # [px] of a thing
POINTS = 20  # on each edge of the outline
SHARES = np.linspace(0.12, 0.88, POINTS)  # of the edge, where they are
LEAST_CONTRAST = 15.0  # hundredths of the strength, from the box to what is around it
WIDE, NARROW = 5.0, 2.5  # [px] to either side of an edge, at first and at last
STAGES = ((find_steps, WIDE, 1.0), (measure_steps, NARROW, 0.05))  # how, within what, and [px] that settle it
MOST_ROUNDS = 2  # of a stage
AGREEING_ROUNDS = 3  # that leave out what does not agree
GOOD = 0.3  # [px] RMS of an outline that needs no other try; measured: 0.1 to 0.3
EDGE_ERROR = 0.06  # [px] that all points of an edge have in common: aliasing, and rounded edges
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
NUDGES = np.array([1e-6, 1e-6, 3e-6])  # [m], [m], [rad] for differences
AROUND = np.vstack((np.zeros(3), np.diag(NUDGES), -np.diag(NUDGES)))  # (7, 3) where the outline is looked at


@dataclass(frozen=True)
class BoxFit:
    """A box that stands on the plane z = 0."""

    plane_from_box: Array  # (4, 4) of the middle of the box
    outline: Array  # (n, 2) [px]
    error: float  # [px] RMS of the outline's points
    covariance: Array  # (3, 3) of x, y [m] and turn [rad]

    @property
    def sigma(self) -> float:
        """[m] standard deviation of the position."""
        return float(np.sqrt(self.covariance[0, 0] + self.covariance[1, 1]))


def colour_strength(image: ColourImage, colour: Sequence[float] | Array) -> Array:
    """How much of `colour` (red, green, blue; 0 to 255) each pixel of `image` (h, w, 3; red first) has: 1 is all of it.

    Grey has none. It is linear in the light, so a blurred edge stays where it is. ValueError for a grey `colour`.
    """
    wanted = np.asarray(colour, dtype=np.float64)
    if np.ptp(wanted) < LEAST_COLOUR:
        raise ValueError(
            f"the colour {tuple(int(value) for value in wanted)} is nearly grey (its parts differ by "
            f"{np.ptp(wanted):.0f}, at least {LEAST_COLOUR:.0f}): put a tag on the thing"
        )
    direction = wanted - wanted.mean()
    weights = direction / (direction @ wanted)
    return np.asarray(cv2.transform(image.astype(np.float32), weights[None].astype(np.float32)), dtype=np.float64)


def coloured_windows(
    half: ColourImage, size: tuple[int, int], colour: Sequence[float] | Array
) -> Iterator[tuple[Window, Mask]]:
    """Where in the image of (height, width) `size` something may have the colour, by its `half`."""
    return windows_around(colour_strength(half, colour) > MASK_SHARE, size, LEAST_AREA // 8, half.size)


def coloured_regions(strength: Array) -> list[Mask]:
    """The masks (h, w) of what has the colour, the largest first."""
    return regions_of(strength > MASK_SHARE, LEAST_AREA)


def region_centre(region: Mask, model: CameraModel, camera_from_plane: Array, height: float) -> Array:
    """Where (3,) [m] on the plane the middle of a region lies, if its middle is `height` [m] above the plane."""
    rows, columns = np.nonzero(region)
    middle = np.array([[columns.mean(), rows.mean()]])
    return np.asarray(on_plane(model.rays(middle), raised(camera_from_plane, height))[0])


def raised(camera_from_plane: Array, height: float) -> Array:
    """The plane (4, 4) moved by `height` [m] along its normal."""
    return camera_from_plane @ rigid(np.zeros(3), np.array([0.0, 0.0, height]))


def fit_box(
    strength: Array, region: Mask, model: CameraModel, camera_from_plane: Array, size: Sequence[float]
) -> BoxFit | None:
    """The box of edges `size` (3,) [m] whose outline is that of `region`; None where no outline can be measured.

    Which of two nearly equal sides is which, the region does not say: where the one does not fit, the other is tried.
    """
    seed = _seed(region, model, camera_from_plane, size)
    fit = _fit_from(seed, strength, model, camera_from_plane, size)
    if size[0] == size[1] or (fit is not None and fit.error < GOOD):
        return fit
    other = _fit_from(seed + np.array([0.0, 0.0, np.pi / 2.0]), strength, model, camera_from_plane, size)
    return min((each for each in (fit, other) if each is not None), key=lambda each: each.error, default=None)


def _fit_from(
    values: Array, strength: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]
) -> BoxFit | None:
    """From x, y [m] and turn [rad] near to which the box stands."""
    brightness = strength * 100.0
    last: _Outline | None = None
    for measure, reach, settled in STAGES:
        for _ in range(MOST_ROUNDS):
            last = _measured(values, brightness, model, camera_from_plane, size, measure, reach)
            if last is None:
                return None
            values = values + last.change
            if np.abs(last.rows @ last.change).max() < settled:
                break
    assert last is not None
    off = (last.left - last.rows @ last.change)[last.weights > 0.0]
    error = float(np.sqrt(np.mean(off**2)))
    normal = last.rows.T @ (last.rows * last.independent[:, None])
    variance = error**2 + LEAST_NOISE**2 + POINTS * EDGE_ERROR**2
    covariance = np.asarray(np.linalg.inv(normal) * variance, dtype=np.float64)
    pose = flat(values)
    pose[2, 3] = size[2] / 2.0
    corners = project_box(values, model, camera_from_plane, size)
    return BoxFit(pose, corners[outline_of(corners)], error, covariance)


@dataclass(frozen=True)
class _Outline:
    """An outline's n points beside the image's edges."""

    left: Array  # (n,) [px] from the outline to the edge, outwards
    rows: Array  # (n, 3) [px/m], [px/m], [px/rad] by x, y and turn
    weights: Array  # (n,) 1 for those that agree, else 0
    independent: Array  # (n,) how many independent ones each stands for
    change: Array  # (3,) of x, y [m] and turn [rad] that brings it to the edges


def _measured(
    values: Array, brightness: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float],
    measure: Measure, reach: float,
) -> _Outline | None:  # fmt: skip
    """The outline of a box at `values`; None where it has too few edges that can be measured."""
    around = project_boxes(values + AROUND, model, camera_from_plane, size)
    ring = outline_of(around[0])
    starts, ends = around[0][ring], around[0][_after(ring)]
    along = ends - starts
    lengths = np.linalg.norm(along, axis=1)
    chosen = lengths > 2.0 * NARROW
    if chosen.sum() < 3:
        return None
    normals = np.stack((along[:, 1], -along[:, 0]), axis=1)[chosen] / lengths[chosen, None]
    points = starts[chosen][:, None] + SHARES[:, None] * along[chosen][:, None]
    steps = measure(brightness, points, normals, np.full((int(chosen.sum()), 2), reach))
    rows = np.einsum("pemk,ek->emp", _slopes(around, ring)[:, chosen], normals).reshape(-1, 3)
    left = steps.offsets.ravel()
    clear = np.repeat(-steps.contrast > LEAST_CONTRAST, POINTS)
    if clear.sum() < 2 * POINTS:
        return None
    change, weights = _agreed(left, rows, clear)
    independent = np.repeat(np.minimum(1.0, lengths[chosen] / POINTS), POINTS) * weights
    return _Outline(left, rows, weights, independent, change)


def _agreed(left: Array, rows: Array, clear: Mask) -> tuple[Array, Array]:
    """The change (3,) of the box that most points agree with, and 1 for these, 0 for those that something else
    covers."""
    weights = clear.astype(float)
    for _ in range(AGREEING_ROUNDS):
        weighed = rows.T * weights
        change = solved(weighed @ rows, weighed @ left)
        off = np.abs(left - rows @ change)
        middle = middles(off[weights > 0.0][None])[0]
        before, weights = weights, (clear & (off <= 3.0 * max(1.4826 * middle, 0.1))).astype(float)
        if (weights == before).all():
            return change, weights
    weighed = rows.T * weights
    return solved(weighed @ rows, weighed @ left), weights


def _seed(region: Mask, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """x, y [m] and turn [rad] of the smallest rectangle around the region, taken at half the height."""
    contour = max(cv2.findContours(region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    halfway = raised(camera_from_plane, size[2] / 2.0)
    places = on_plane(model.rays(contour[:, 0].astype(float)), halfway)[:, :2]
    (x, y), (width, depth), degrees = cv2.minAreaRect((1000.0 * places).astype(np.float32))
    turned = np.radians(degrees) + (np.pi / 2.0 if (width > depth) != (size[0] > size[1]) else 0.0)
    return np.array([x / 1000.0, y / 1000.0, turned])


def project_box(values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """(8, 2) [px] of the corners of a box of edges `size` (3,) [m] that stands on the plane at `values` (3,)."""
    return np.asarray(project_boxes(values[None], model, camera_from_plane, size)[0], dtype=np.float64)


def project_boxes(values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """The pixels (n, 8, 2) of the corners of boxes that stand at `values` (n, 3): x, y [m] and turn [rad]."""
    x, y, z = (CORNERS * np.asarray(size)).T
    cosine, sine = np.cos(values[:, 2:]), np.sin(values[:, 2:])
    places = np.empty((len(values), len(CORNERS), 3))
    places[..., 0] = values[:, :1] + cosine * x - sine * y
    places[..., 1] = values[:, 1:2] + sine * x + cosine * y
    places[..., 2] = z
    return model.project(apply(camera_from_plane, places.reshape(-1, 3))).reshape(len(values), -1, 2)


def outline_of(corners: Array) -> Index:
    """Which of a box's corners (8, 2) [px] are its outline, clockwise in the image."""
    ring = cv2.convexHull(corners.astype(np.float32), clockwise=True, returnPoints=False)[:, 0].astype(np.intp)
    area = cv2.contourArea(corners[ring].astype(np.float32), oriented=True)
    return np.asarray(ring if area > 0.0 else ring[::-1], dtype=np.intp)


def _after(ring: Index) -> Index:
    """Each one's successor on the ring."""
    return np.concatenate((ring[1:], ring[:1]))


def _slopes(around: Array, ring: Index) -> Array:
    """(3, edges, m, 2): how the points at SHARES (m,) of the outline's edges move with x, y and turn, by the corners
    `around` (7, 8, 2) the place."""
    by = (around[1:4] - around[4:]) / (2.0 * NUDGES[:, None, None])
    starts, ends = by[:, ring], by[:, _after(ring)]
    return np.asarray(starts[:, :, None] + SHARES[:, None] * (ends - starts)[:, :, None])
