"""Boxes and coloured things on a known plane: the silhouette of a box of known size is fitted in x, y and turn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.camera_model import CameraModel
from services.vision.edges import LEAST_NOISE, Index, find_steps, measure_steps
from services.vision.rigid import Array, apply, rigid
from services.vision.tag_pose import flat, on_plane

ColourImage = NDArray[np.uint8]

LEAST_COLOUR = 40.0  # grey levels between the strongest and the weakest of a colour's red, green and blue
MASK_SHARE = 0.35  # of the colour's own strength makes a pixel part of a thing
LEAST_AREA = 60  # [px] of a thing
POINTS = 20  # on each edge of the outline
WIDE, NARROW = 5.0, 2.5  # [px] to either side of an edge, at first and at last
ROUNDS = ((find_steps, WIDE), (find_steps, WIDE), (measure_steps, NARROW), (measure_steps, NARROW))
GOOD = 0.3  # [px] RMS of an outline that needs no other try; measured: 0.1 to 0.3
EDGE_ERROR = 0.06  # [px] that all points of an edge have in common: aliasing, and rounded edges
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0.0, 1.0)])
NUDGES = np.diag([1e-6, 1e-6, 3e-6])  # [m], [m], [rad] for differences


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


def coloured_regions(strength: Array) -> list[NDArray[np.bool_]]:
    """The masks (h, w) of what has the colour, the largest first."""
    mask = (strength > MASK_SHARE).astype(np.uint8)
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    areas = statistics[:, cv2.CC_STAT_AREA]
    chosen = [label for label in range(1, count) if areas[label] >= LEAST_AREA]
    return [labels == label for label in sorted(chosen, key=lambda label: -int(areas[label]))]


def region_centre(region: NDArray[np.bool_], model: CameraModel, camera_from_plane: Array, height: float) -> Array:
    """Where (3,) [m] on the plane the middle of a region lies, if its middle is `height` [m] above the plane."""
    rows, columns = np.nonzero(region)
    middle = np.array([[columns.mean(), rows.mean()]])
    return np.asarray(on_plane(model.rays(middle), raised(camera_from_plane, height))[0])


def raised(camera_from_plane: Array, height: float) -> Array:
    """The plane moved by `height` [m] along its normal."""
    return camera_from_plane @ rigid(np.zeros(3), np.array([0.0, 0.0, height]))


def fit_box(
    strength: Array, region: NDArray[np.bool_], model: CameraModel, camera_from_plane: Array, size: Sequence[float]
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
    for measure, reach in ROUNDS:
        corners, ring = _outline(values, model, camera_from_plane, size)
        starts, ends = corners[ring], corners[np.roll(ring, -1)]
        along = ends - starts
        lengths = np.linalg.norm(along, axis=1)
        chosen = lengths > 2.0 * NARROW
        if chosen.sum() < 3:
            return None
        normals = np.stack((along[:, 1], -along[:, 0]), axis=1)[chosen] / lengths[chosen, None]
        shares = np.linspace(0.12, 0.88, POINTS)
        points = starts[chosen][:, None] + shares[:, None] * along[chosen][:, None]
        steps = measure(strength * 100.0, points, normals, np.full((int(chosen.sum()), 2), reach))
        slope = _slopes(values, model, camera_from_plane, size, ring, shares)[:, chosen]
        rows = np.einsum("pemk,ek->emp", slope, normals).reshape(-1, 3)
        left = steps.offsets.ravel()
        clear = np.repeat(-steps.contrast > 15.0, POINTS)
        if clear.sum() < 2 * POINTS:
            return None
        weights = _weights(left, rows, clear)
        change = np.linalg.lstsq(rows * weights[:, None], left * weights, rcond=None)[0]
        values = values + change
    off = (left - rows @ change)[weights > 0.0]
    error = float(np.sqrt(np.mean(off**2)))
    independent = np.repeat(np.minimum(1.0, lengths[chosen] / POINTS), POINTS) * weights
    normal = rows.T @ (rows * independent[:, None])
    covariance = np.linalg.inv(normal) * (error**2 + LEAST_NOISE**2 + POINTS * EDGE_ERROR**2)
    pose = flat(values)
    pose[2, 3] = size[2] / 2.0
    corners, ring = _outline(values, model, camera_from_plane, size)
    return BoxFit(pose, corners[ring], error, covariance)


def _weights(left: Array, rows: Array, clear: NDArray[np.bool_]) -> Array:
    """1 for the points that agree with a common shift of the box, 0 for those that something else covers."""
    weights = clear.astype(float)
    for _ in range(3):
        change = np.linalg.lstsq(rows * weights[:, None], left * weights, rcond=None)[0]
        off = left - rows @ change
        middle = np.median(np.abs(off[weights > 0.0]))
        weights = (clear & (np.abs(off) <= 3.0 * max(1.4826 * middle, 0.1))).astype(float)
    return weights


def _seed(region: NDArray[np.bool_], model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """x, y [m] and turn [rad] of the smallest rectangle around the region, taken at half the height."""
    contour = max(cv2.findContours(region.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    halfway = raised(camera_from_plane, size[2] / 2.0)
    places = on_plane(model.rays(contour[:, 0].astype(float)), halfway)[:, :2]
    (x, y), (width, depth), degrees = cv2.minAreaRect((1000.0 * places).astype(np.float32))
    turned = np.radians(degrees) + (np.pi / 2.0 if (width > depth) != (size[0] > size[1]) else 0.0)
    return np.array([x / 1000.0, y / 1000.0, turned])


def project_box(values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """The pixels (8, 2) of the box's corners."""
    return model.project(apply(camera_from_plane @ flat(values), CORNERS * np.asarray(size)))


def _outline(values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> tuple[Array, Index]:
    """The pixels (8, 2) of the corners, and which of them are the outline, clockwise in the image."""
    corners = project_box(values, model, camera_from_plane, size)
    ring = cv2.convexHull(corners.astype(np.float32), clockwise=True, returnPoints=False)[:, 0].astype(np.intp)
    area = cv2.contourArea(corners[ring].astype(np.float32), oriented=True)
    return corners, ring if area > 0.0 else ring[::-1]


def _slopes(
    values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float], ring: Index, shares: Array
) -> Array:
    """(3, edges, m, 2): how the points at `shares` (m,) of the outline's edges move with x, y and turn."""
    moves = []
    for nudge, length in zip(NUDGES, np.diag(NUDGES), strict=True):
        ahead = project_box(values + nudge, model, camera_from_plane, size)
        behind = project_box(values - nudge, model, camera_from_plane, size)
        by = (ahead - behind) / (2.0 * length)
        starts, ends = by[ring], by[np.roll(ring, -1)]
        moves.append(starts[:, None] + shares[:, None] * (ends - starts)[:, None])
    return np.array(moves)
