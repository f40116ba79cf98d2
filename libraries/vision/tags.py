"""Tags in a grey image: OpenCV finds and decodes them, and straight lines through their four edges give the corners.

OpenCV's own corner refinements are not used: SUBPIX and CONTOUR draw the corners inwards by about 1 px, which is
centimetres in range; APRILTAG stands half a pixel off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.edges import (
    LEAST_NOISE,
    Index,
    Lines,
    Measure,
    Steps,
    find_steps,
    fit_lines,
    measure_steps,
)
from gemelo.schemas.cell import TagFamily

Array = NDArray[np.float64]
GreyImage = NDArray[np.uint8]

FAMILIES = {  # OpenCV's dictionary, modules from edge to edge
    TagFamily.APRILTAG_36H11: (cv2.aruco.DICT_APRILTAG_36h11, 8),
    TagFamily.APRILTAG_25H9: (cv2.aruco.DICT_APRILTAG_25h9, 7),
    TagFamily.ARUCO_4X4_50: (cv2.aruco.DICT_4X4_50, 6),
    TagFamily.ARUCO_5X5_100: (cv2.aruco.DICT_5X5_100, 7),
    TagFamily.ARUCO_6X6_250: (cv2.aruco.DICT_6X6_250, 8),
}
DEFAULT_FAMILY = TagFamily.APRILTAG_36H11
AFTER, BEFORE = np.array([1, 2, 3, 0]), np.array([3, 0, 1, 2])  # of each corner
LEAST_CONTRAST = 12.0  # grey levels between a tag's border and the paper around it
ROUNDS = (find_steps, measure_steps, measure_steps)
LONGEST_REACH, SHORTEST_REACH = 3.0, 1.2  # [px] to either side of an edge
# Of a module, inside and outside: the data begins one module inside, the paper ends one outside. Nearly the same on
# both sides: a pixel's profile is no exact Gaussian step, and a window that is longer on one side is drawn to it.
REACH_SHARES = np.array([0.45, 0.55])
CORNER_SPREADS = 2.2  # of an edge, next to a corner: so far the other edge is seen too
START_SPREAD, LEAST_SPREAD = 0.8, 0.6  # [px]
SETTLED = 0.1, 0.15  # [px] of the corners and of the spread: a round that changes less is the last
POINTS, FEWEST_POINTS = 32, 4  # on an edge
SHARES = np.linspace(0.0, 1.0, POINTS)
LEAST_MODULE = 1.5  # [px] below which a tag is not measured
LARGEST_SHIFT = 0.12  # of the diagonal, from OpenCV's outline
SYSTEMATIC = 0.012  # [px] of a corner: aliasing of the pixels, and the data one module inside the edge
LEAST_KEPT = 0.5  # of an edge's points on one line
SHARP = 0.9  # [px] spread of an edge that stands still and is in focus
BLUR_ERROR = 0.25  # [px] of error for each px of spread beyond that


@dataclass(frozen=True)
class Tag:
    """One tag in an image; corners in the order upper left, upper right, lower right, lower left of the tag."""

    id: int
    corners: Array  # (4, 2) [px] as the image has them
    ideal: Array  # (4, 2) [px] without the lens's distortion
    sigma: float  # [px] standard deviation of a corner along either axis
    spread: float  # [px] of the least sharp edge
    evenness: float = 1.0  # contrast of its faintest edge beside that of its clearest: low where something hides one


@cache
def finder(family: TagFamily) -> cv2.aruco.ArucoDetector:
    """OpenCV's detector of a family, without any refinement."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_NONE
    return cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(FAMILIES[family][0]), parameters)


def find_tags(
    image: GreyImage, model: CameraModel | None = None, family: TagFamily = DEFAULT_FAMILY
) -> tuple[Tag, ...]:
    """All tags of `image` (h, w) by id, their corners refined; without a `model` the lens counts as ideal."""
    outlines, ids, _ = finder(family).detectMarkers(image)
    if not len(outlines):
        return ()
    corners = np.array(outlines, dtype=np.float64).reshape(-1, 4, 2)
    modules = FAMILIES[family][1]
    lengths = np.linalg.norm(corners[:, AFTER] - corners, axis=2)
    is_large = lengths.min(axis=1) >= LEAST_MODULE * modules
    if not is_large.any():
        return ()
    found = refined(image, ids.ravel()[is_large], corners[is_large], model, modules)
    return tuple(sorted(found, key=lambda tag: (tag.id, tuple(tag.corners[0]))))


def refined(image: GreyImage, ids: Index, outlines: Array, model: CameraModel | None, modules: int) -> list[Tag]:
    """The tags with outlines (n, 4, 2), their corners where the lines through their edges meet; one that has an edge
    that cannot be measured is left out."""
    corners = ideal = outlines
    spread = np.full(len(ids), START_SPREAD)
    for measure in ROUNDS:
        margin = CORNER_SPREADS * np.maximum(spread, LEAST_SPREAD)
        lines, steps, count = edge_lines(image, corners, model, modules, measure, margin)
        edges = np.arange(4 * len(ids), dtype=np.intp).reshape(-1, 4)
        ideal = lines.crossings(edges[:, BEFORE].ravel(), edges.ravel()).reshape(-1, 4, 2)
        before = corners, spread
        is_good = _plausible(ideal, corners if model is None else _ideal(model, corners), lines, steps)
        ideal = np.where(is_good[:, None, None], ideal, corners)
        corners = ideal if model is None else model.real(ideal.reshape(-1, 2)).reshape(-1, 4, 2)
        if measure is measure_steps:
            spread = steps.spread.reshape(-1, 4).max(axis=1)
            changes = [np.abs(now - was).max() for now, was in zip((corners, spread), before, strict=True)]
            if changes[0] < SETTLED[0] and changes[1] < SETTLED[1]:
                break
    edge_sigma = 2.0 * np.hypot(lines.scatter, LEAST_NOISE).reshape(-1, 4) / np.sqrt(count)[:, None]
    blur = BLUR_ERROR * np.maximum(0.0, spread - SHARP)
    sigma = np.sqrt(np.mean(edge_sigma**2, axis=1) + blur**2 + SYSTEMATIC**2)
    contrast = steps.contrast.reshape(-1, 4)
    evenness = contrast.min(axis=1) / np.maximum(contrast.max(axis=1), LEAST_CONTRAST)
    return [
        Tag(
            int(ids[index]),
            corners[index],
            ideal[index],
            float(sigma[index]),
            float(spread[index]),
            float(evenness[index]),
        )
        for index in np.flatnonzero(is_good)
    ]


def _ideal(model: CameraModel, corners: Array) -> Array:
    return model.ideal(corners.reshape(-1, 2)).reshape(corners.shape)


def _plausible(ideal: Array, before: Array, lines: Lines, steps: Steps) -> NDArray[np.bool_]:
    """(n,) True for tags whose edges are dark to bright, straight, and where the outline is."""
    size = np.linalg.norm(before[:, 0] - before[:, 2], axis=1)
    with np.errstate(invalid="ignore"):
        is_near = np.abs(ideal - before).max(axis=(1, 2)) < LARGEST_SHIFT * size
    is_clear = (steps.contrast.reshape(-1, 4) >= LEAST_CONTRAST).all(axis=1)
    is_straight = (lines.kept.reshape(-1, 4) >= LEAST_KEPT).all(axis=1)
    return np.asarray(is_near & is_clear & is_straight)


def edge_lines(
    image: GreyImage, corners: Array, model: CameraModel | None, modules: int, measure: Measure, margin: Array
) -> tuple[Lines, Steps, Array]:
    """The lines through the edges from corner i to i + 1 of tags (n, 4, 2) without `margin` (n,) [px] at both ends,
    their steps, and how many independent points an edge of each tag has (n,)."""
    starts, ends = corners.reshape(-1, 2), corners[:, AFTER].reshape(-1, 2)
    lengths = np.linalg.norm(ends - starts, axis=1)
    shortest = lengths.reshape(-1, 4).min(axis=1)
    module = np.repeat(shortest / modules, 4)
    reach = np.clip(module[:, None] * REACH_SHARES, SHORTEST_REACH, LONGEST_REACH)
    along = (ends - starts) / lengths[:, None]
    normals = np.stack((along[:, 1], -along[:, 0]), axis=1)  # outwards: the corners go clockwise in the image
    margins = np.minimum(np.repeat(margin, 4) / lengths, 0.25)
    shares = margins[:, None] + SHARES * (1.0 - 2.0 * margins[:, None])
    points = starts[:, None, :] + shares[:, :, None] * (ends - starts)[:, None, :]
    steps = measure(image, points, normals, reach)
    found = points + steps.offsets[:, :, None] * normals[:, None, :]
    lines = fit_lines(found if model is None else _ideal(model, found))
    return lines, steps, np.clip(shortest - 2.0 * margin, FEWEST_POINTS, POINTS)


def doubled(tags: Sequence[Tag]) -> tuple[int, ...]:
    """The ids that are seen more than once."""
    ids = [tag.id for tag in tags]
    return tuple(sorted({number for number in ids if ids.count(number) > 1}))


def tag_modules(number: int, family: TagFamily = DEFAULT_FAMILY) -> NDArray[np.bool_]:
    """The modules (n, n) of a printed tag, rows from the top: True is white; the outer ring is black."""
    dictionary, count = FAMILIES[family]
    image = cv2.aruco.getPredefinedDictionary(dictionary).generateImageMarker(number, count)
    return np.asarray(image > 127)
