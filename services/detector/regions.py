"""One image with what is known of its camera, and regions of it: how they look, and what they may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np

from gemelo.libraries.vision.boxes import BoxFit, ColourImage, raised
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, inverse, to_transform
from gemelo.libraries.vision.windows import Mask, Window, halved
from gemelo.schemas.cell import ColourThing
from gemelo.schemas.detections import Detection, Unclear
from gemelo.schemas.frames import Transform
from gemelo.schemas.reasons import because

# Tuning constants: chosen, where a line does not say measured.
LARGEST_ERROR = 0.7  # [px] RMS of an outline that is a box; measured: 0.1 to 0.3 for boxes, above 1 for what is none
LIKE_AREA = (0.75, 1.35)  # of a region to that of the box which was fitted to it


@dataclass(frozen=True)
class DetectorView:
    """One image with all that is known of it."""

    image: ColourImage  # (h, w, 3) red first
    model: CameraModel
    base_from_camera: Array | None  # (4, 4); None where it is not known
    mount_error: float  # [m] of `base_from_camera`, as it was measured

    def plane(self, height: float) -> Array | None:
        """camera_from_plane (4, 4) of the plane `height` [m] above the base; None if that is not known."""
        if self.base_from_camera is None:
            return None
        return raised(inverse(self.base_from_camera), height)

    @cached_property
    def half(self) -> ColourImage:
        """The image at half its size."""
        return halved(self.image)

    def within(self, window: Window) -> DetectorView:
        """What the window shows of it."""
        return replace(self, image=window.of(self.image), model=self.model.within(window))


def unclear_region(things: Sequence[ColourThing], region: Mask, window: Window) -> Unclear:
    """A region of the things' colour whose outline is that of none of them."""
    rows, columns = np.nonzero(region)
    left, right = columns.min() + window.left, columns.max() + 1 + window.left
    upper, lower = rows.min() + window.top, rows.max() + 1 + window.top
    sizes = sorted({tuple(1e3 * edge for edge in thing.box) for thing in things})
    boxes = tuple(" x ".join(f"{edge:g}" for edge in size) for size in sizes)
    why = because("detect.outline", colour=things[0].colour.value, boxes=boxes)
    return Unclear(
        names=tuple(thing.name for thing in things),
        corners=rows_of(np.array([[left, upper], [right, upper], [right, lower], [left, lower]], dtype=np.float64)),
        reason=str(why),
        why=why,
    )


def in_base(view: DetectorView, pose: Array) -> Transform:
    """A pose (4, 4) [m] of the camera's frame in the base frame; the identity where the camera's is not known."""
    return Transform() if view.base_from_camera is None else to_transform(view.base_from_camera @ pose)


def is_box(fit: BoxFit, region: Mask) -> bool:
    """True if the region is as large as the box that was fitted to it, and its outline as straight."""
    area = float(cv2.contourArea(fit.outline.astype(np.float32)))
    return fit.error < LARGEST_ERROR and LIKE_AREA[0] < float(region.sum()) / max(area, 1.0) < LIKE_AREA[1]


def median_colour(image: ColourImage) -> Array:
    """(3,) the median of each of an image's colours."""
    counts = [np.bincount(image[..., channel].ravel(), minlength=256) for channel in range(3)]
    return np.array([float(np.searchsorted(np.cumsum(each), each.sum() / 2.0)) for each in counts])


def distances_from(image: ColourImage, colour: Array) -> Array:
    """(h, w) the distance of each pixel's colour from `colour` (3,)."""
    off = image.astype(np.float32) - colour.astype(np.float32)
    return np.asarray(np.sqrt(np.einsum("ijk,ijk->ij", off, off)), dtype=np.float64)


def is_known(region: Mask, window: Window, found: Sequence[Detection]) -> bool:
    """True if the middle of something that was found already lies in the region of the window."""
    for item in found:
        column, row = np.rint(np.mean(item.corners, axis=0)).astype(int) - (window.left, window.top)
        if 0 <= row < region.shape[0] and 0 <= column < region.shape[1] and region[row, column]:
            return True
    return False


def rows_of(points: Array) -> tuple[tuple[float, ...], ...]:
    """Pixels (n, 2) [px] as a message has them: n rows of two."""
    return tuple(tuple(float(value) for value in row) for row in points)
