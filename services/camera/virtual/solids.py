"""The solids that the virtual camera draws: plane convex faces with a colour or a texture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid

Array = NDArray[np.float64]
Texture = NDArray[np.uint8]
Colour = tuple[int, int, int]  # red, green, blue, 0 to 255

INK, PAPER = 20, 235  # grey of printed tags
SIDES = 20  # of what is round
STACKS = 10  # of a ball, from pole to pole


@dataclass(frozen=True, eq=False)
class Face:
    """A plane convex polygon: `corners` (n, 3) [m], counter-clockwise as seen from outside.

    A grey `texture` (rows, columns) covers a parallelogram: its top left, bottom left, bottom right and top right are
    the corners in this order.
    """

    corners: Array
    colour: Colour = (128, 128, 128)
    texture: Texture | None = None

    def moved(self, by: tuple[float, float, float]) -> Face:
        """The same face `by` [m] from there."""
        return replace(self, corners=self.corners + np.array(by))


@dataclass(frozen=True, eq=False)
class PosedSolid:
    """Faces in a frame of their own, and the pose of that frame in the base ([m], quaternion)."""

    faces: tuple[Face, ...]
    pose: Rigid = IDENTITY


def box(size: tuple[float, float, float], colour: Colour, pose: Rigid = IDENTITY) -> PosedSolid:
    """A box around its origin; `size` (3,) [m] are whole edges."""
    x, y, z = (edge / 2.0 for edge in size)
    corners = np.array([[i, j, k] for i in (-x, x) for j in (-y, y) for k in (-z, z)])
    rings = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    return PosedSolid(tuple(Face(corners[list(ring)], colour) for ring in rings), pose)


def cylinder(radius: float, length: float, colour: Colour, pose: Rigid = IDENTITY) -> PosedSolid:
    """A prism of `SIDES` sides around the axis z; `radius` and `length` in [m]."""
    top = _ring(radius, length / 2.0)
    bottom = _ring(radius, -length / 2.0)
    sides = [Face(np.array([bottom[i], bottom[j], top[j], top[i]]), colour) for i, j in pairwise([*range(SIDES), 0])]
    return PosedSolid((Face(top, colour), Face(bottom[::-1], colour), *sides), pose)


def sphere(radius: float, colour: Colour, pose: Rigid = IDENTITY) -> PosedSolid:
    """A ball of `STACKS` rings of faces; `radius` in [m]."""
    angles = np.linspace(-np.pi / 2.0, np.pi / 2.0, STACKS + 1)
    rings = [_ring(radius * np.cos(angle), radius * np.sin(angle)) for angle in angles]
    faces = []
    for depth, (low, high) in enumerate(pairwise(rings)):
        for i, j in pairwise([*range(SIDES), 0]):
            quad = np.array([low[i], low[j], high[j], high[i]])
            kept = quad[[0, 2, 3]] if depth == 0 else quad[[0, 1, 3]] if depth == STACKS - 1 else quad
            faces.append(Face(kept, colour))
    return PosedSolid(tuple(faces), pose)


def triangles(vertices: Array, numbers: NDArray[np.int32], colour: Colour, pose: Rigid = IDENTITY) -> PosedSolid:
    """A mesh: `vertices` (v, 3) [m] and the `numbers` (f, 3) of each triangle's corners."""
    return PosedSolid(tuple(Face(vertices[row], colour) for row in numbers), pose)


def printed(texture: Texture, width: float, height: float, pose: Rigid = IDENTITY) -> PosedSolid:
    """A grey picture on paper of `width` x `height` [m]: in the plane z = 0, seen from z > 0, x to its right, y up."""
    x, y = width / 2.0, height / 2.0
    corners = np.array([[-x, y, 0.0], [-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0]])
    return PosedSolid((Face(corners, texture=texture),), pose)


def tag(family: str, number: int, size: float, pose: Rigid = IDENTITY) -> PosedSolid:
    """A printed tag with a margin of one cell; `size` [m] is the edge of its black square.

    `family` is the name of one of OpenCV's dictionaries, for example "apriltag_36h11" or "aruco_4x4_50". The frame has
    z out of the paper, x to the right and y up as the tag is printed.
    """
    cells = tag_cells(family, number)
    whole = size * len(cells) / (len(cells) - 2)
    return printed(cells, whole, whole, pose)


def tag_cells(family: str, number: int) -> Texture:
    """The tag's cells with its black border and one white cell around: (n + 4, n + 4) of `INK` and `PAPER`."""
    name = family.upper().removeprefix("ARUCO_")
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name}"))
    side = dictionary.markerSize + 2
    bits = cv2.aruco.generateImageMarker(dictionary, number, side)
    return np.pad(np.where(bits > 0, np.uint8(PAPER), np.uint8(INK)), 1, constant_values=PAPER)


def _ring(radius: float, height: float) -> Array:
    """(SIDES, 3), counter-clockwise as seen from above."""
    angles = np.arange(SIDES) * (2.0 * np.pi / SIDES)
    return np.stack((radius * np.cos(angles), radius * np.sin(angles), np.full(SIDES, height)), axis=1)
