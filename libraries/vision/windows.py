"""Windows of an image that may hold something: found at half its size, so that only they are examined in full."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

MARGIN = 8  # [px] of the halved image around a region: 16 of the whole, more than any edge is looked for beyond it


@dataclass(frozen=True)
class Window:
    """A rectangle of an image, in whole pixels."""

    left: int
    top: int
    width: int
    height: int

    def of(self, image: Image) -> Image:
        """The part of `image` (h, w) or (h, w, c) that it shows; no copy."""
        return image[self.top : self.top + self.height, self.left : self.left + self.width]


def halved(image: Image) -> Image:
    """The image (h, w, c) at half its size: each pixel the mean of four."""
    height, width = image.shape[:2]
    return np.asarray(cv2.resize(image, (width // 2, height // 2), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def windows_around(mask: Mask, size: tuple[int, int], fewest: int, most: float) -> Iterator[tuple[Window, Mask]]:
    """A window of the whole image, whose (height, width) are `size`, around each connected region of the halved
    image's `mask` that has `fewest` to `most` pixels; and the region in it, (h, w) of the window."""
    height, width = mask.shape
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    for label in range(1, count):
        left, top, across, down, area = (int(value) for value in statistics[label])
        if not fewest <= area <= most:
            continue
        x, y = max(left - MARGIN, 0), max(top - MARGIN, 0)
        right, bottom = min(left + across + MARGIN, width), min(top + down + MARGIN, height)
        # Of an odd size the last row or column belongs to the windows at the border.
        window = Window(
            2 * x,
            2 * y,
            (size[1] if right == width else 2 * right) - 2 * x,
            (size[0] if bottom == height else 2 * bottom) - 2 * y,
        )
        region = (labels[y:bottom, x:right] == label).astype(np.uint8)
        whole = cv2.resize(region, (window.width, window.height), interpolation=cv2.INTER_NEAREST)
        yield window, np.asarray(whole, dtype=np.bool_)


def regions_of(mask: Mask, fewest: int) -> list[Mask]:
    """The connected regions of a mask (h, w) that have at least `fewest` pixels, the largest first."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    areas = statistics[:, cv2.CC_STAT_AREA]
    chosen = [label for label in range(1, count) if areas[label] >= fewest]
    return [labels == label for label in sorted(chosen, key=lambda label: -int(areas[label]))]
