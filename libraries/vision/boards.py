"""Printed boards: squares of paper and ink of known size, and the points of them that an image shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array
from gemelo.libraries.vision.tag_pose import square
from gemelo.libraries.vision.tags import FAMILIES, GreyImage, doubled, find_tags, tag_modules
from gemelo.schemas.cell import TagFamily
from gemelo.schemas.reasons import Reason, because

BOARD_FAMILY = TagFamily.ARUCO_5X5_100  # of the markers between the chessboard's squares
EVEN = 0.87  # of its clearest edge's contrast the faintest edge of a tag has, or it is partly hidden
CORNERS = ("upper left", "upper right", "lower right", "lower left")  # of a tag, as `square`, and `word.quarter`
FEWEST_CORNERS = 8  # of a chessboard make a shot
Square = tuple[float, float, float]  # left, lower edge, size [m] of what is black


@dataclass(frozen=True)
class Sighting:
    """Points of a board where an image shows them."""

    points: Array  # (n, 3) [m] on the board
    pixels: Array  # (n, 2) [px]
    sigma: float = 0.05  # [px] standard deviation of a pixel's coordinate
    doubled: tuple[int, ...] = ()  # ids that were seen twice, and were not used
    uneven: tuple[int, ...] = ()  # ids of tags of which something hides an edge, or lights it less; they were not used


@dataclass(frozen=True)
class ChessBoard:
    """A ChArUco board: a chessboard with tags in its white squares. Its origin is its lower left corner, y is up."""

    columns: int = 8
    rows: int = 6
    edge: float = 0.025  # [m] of a square
    marker: float = 0.018  # [m] of a tag

    @cached_property
    def pattern(self) -> cv2.aruco.CharucoBoard:
        """As OpenCV has it, with y down from the upper left corner."""
        dictionary = cv2.aruco.getPredefinedDictionary(FAMILIES[BOARD_FAMILY][0])
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.edge, self.marker, dictionary)

    @property
    def size(self) -> tuple[float, float]:
        """[m] width and height."""
        return self.columns * self.edge, self.rows * self.edge

    def squares(self) -> list[Square]:
        """All that is black."""
        height, found, number = self.size[1], [], 0
        for row in range(self.rows):
            for column in range(self.columns):
                left, lower = column * self.edge, height - (row + 1) * self.edge
                if (row + column) % 2 == 0:
                    found.append((left, lower, self.edge))
                else:
                    inset = (self.edge - self.marker) / 2.0
                    found += tag_squares(number, BOARD_FAMILY, left + inset, lower + inset, self.marker)
                    number += 1
        return found

    def find(self, image: GreyImage) -> Sighting | None:
        """The corners of the chessboard; None where too few are seen."""
        corners, ids, _, _ = cv2.aruco.CharucoDetector(self.pattern).detectBoard(image)
        if ids is None or len(ids) < FEWEST_CORNERS:
            return None
        points = np.asarray(self.pattern.getChessboardCorners(), dtype=np.float64)[ids.ravel()]
        upward = points * (1.0, -1.0, 1.0) + (0.0, self.size[1], 0.0)
        return Sighting(upward, np.asarray(corners, dtype=np.float64).reshape(-1, 2))


@dataclass(frozen=True)
class TagBoard:
    """A grid of tags. Its origin is the middle of the grid, x to the right, y up."""

    columns: int = 3
    rows: int = 3
    tag: float = 0.03  # [m] edge of a tag
    pitch: float = 0.045  # [m] from tag to tag
    first: int = 0  # id of the upper left tag; the others follow along the rows
    family: TagFamily = TagFamily.APRILTAG_36H11

    @property
    def size(self) -> tuple[float, float]:
        """[m] width and height."""
        return (self.columns - 1) * self.pitch + self.tag, (self.rows - 1) * self.pitch + self.tag

    def centres(self) -> dict[int, Array]:
        """Where (3,) [m] the middle of each tag is, by its id."""
        return {
            self.first + row * self.columns + column: np.array(
                [
                    (column - (self.columns - 1) / 2.0) * self.pitch,
                    ((self.rows - 1) / 2.0 - row) * self.pitch,
                    0.0,
                ]
            )
            for row in range(self.rows)
            for column in range(self.columns)
        }

    def points(self) -> Array:
        """(n, 3) [m] the corners of all its tags."""
        return np.vstack([square(self.tag) + centre for centre in self.centres().values()])

    def corner_name(self, index: int) -> Reason:
        """What the corner is called that is the so manieth of `points`, on the upright page."""
        number = list(self.centres())[index // len(CORNERS)]
        return because("measure.corner", corner=CORNERS[index % len(CORNERS)], tag=number)

    def squares(self) -> list[Square]:
        """All that is black, from the lower left corner of the board."""
        width, height = self.size
        found: list[Square] = []
        for number, centre in self.centres().items():
            left, lower = centre[0] + width / 2.0 - self.tag / 2.0, centre[1] + height / 2.0 - self.tag / 2.0
            found += tag_squares(number, self.family, float(left), float(lower), self.tag)
        return found

    def find(self, image: GreyImage, model: CameraModel | None = None) -> Sighting | None:
        """The corners of the tags, without those whose id is seen twice or that are partly hidden; None where no tag of
        the board is seen."""
        tags = find_tags(image, model, self.family)
        twice = doubled(tags)
        centres = self.centres()
        once = [tag for tag in tags if tag.id in centres and tag.id not in twice]
        uneven = tuple(tag.id for tag in once if tag.evenness < EVEN)
        seen = [tag for tag in once if tag.evenness >= EVEN]
        if not once:
            return None
        if not seen:
            return Sighting(np.zeros((0, 3)), np.zeros((0, 2)), doubled=twice, uneven=uneven)
        points = np.vstack([square(self.tag) + centres[tag.id] for tag in seen])
        sigma = float(np.median([tag.sigma for tag in seen]))
        return Sighting(points, np.vstack([tag.corners for tag in seen]), sigma, twice, uneven)


@dataclass(frozen=True)
class Scale:
    """How large a page really is: what the bar on it measures beside what it should."""

    measured: float = 0.1  # [m]
    nominal: float = field(default=0.1)  # [m]

    def __post_init__(self) -> None:
        share = self.measured / self.nominal
        if not 0.8 < share < 1.25:
            nominal, measured = 1000 * self.nominal, 1000 * self.measured
            limits = {"least": 0.8 * nominal, "most": 1.25 * nominal}
            raise NotMeasured(because("measure.bar", nominal=nominal, measured=measured, **limits))

    def of(self, length: float) -> float:
        """[m] what `length` of the page is on the paper."""
        return length * self.measured / self.nominal


def tag_squares(number: int, family: TagFamily, left: float, lower: float, size: float) -> list[Square]:
    """The black modules of a tag of `size` [m] whose lower left corner [m] is given."""
    modules: NDArray[np.bool_] = tag_modules(number, family)
    count = len(modules)
    module = size / count
    return [
        (left + column * module, lower + (count - 1 - row) * module, module)
        for row in range(count)
        for column in range(count)
        if not modules[row, column]
    ]


def picture(squares: Sequence[Square], size: tuple[float, float], margin: float, dots_per_metre: float) -> GreyImage:
    """The board of `size` as an image with a white `margin`, both [m], for a screen or a test."""
    width, height = (round((edge + 2.0 * margin) * dots_per_metre) for edge in size)
    image = np.full((height, width), 255, np.uint8)
    for left, lower, edge in squares:
        x0, x1 = (round((margin + left + step) * dots_per_metre) for step in (0.0, edge))
        y0, y1 = (height - round((margin + lower + step) * dots_per_metre) for step in (edge, 0.0))
        image[y0:y1, x0:x1] = 0
    return image
