"""The interface of every source of images: its frames and its faults."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.camera import CameraCondition
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because

JPEG_QUALITY = 90


@dataclass(frozen=True, eq=False)
class EncodedImage:
    """One image, encoded; `stamp` [ns] UNIX time of capture."""

    stamp: int
    width: int  # [px]
    height: int  # [px]
    data: bytes
    encoding: str = "jpeg"


class CameraFault(ReasonedError):
    """Why there is no image: a condition, and what would do."""

    def __init__(self, condition: CameraCondition, reason: Reason) -> None:
        super().__init__(reason)
        self.condition = condition


def fault_of(camera: str, condition: CameraCondition, what: Reason) -> CameraFault:
    """The fault of a camera of the cell."""
    return CameraFault(condition, because("camera.fault", what, camera=camera))


class CameraSource(Protocol):
    """One camera, or what stands for it. All of it is called from one thread, which may be another than logic's."""

    @property
    def period(self) -> float:
        """[s] to wait between two images; 0 where `read` waits by itself."""
        ...

    @property
    def is_live(self) -> bool:
        """True where two equal images mean that it is stuck: a sensor's noise never repeats."""
        ...

    def open(self) -> None:
        """Raises `CameraFault`; may be called again after `close`."""
        ...

    def read(self) -> EncodedImage:
        """The next image; raises `CameraFault`."""
        ...

    def close(self) -> None: ...


def encoded(image: NDArray[np.uint8]) -> bytes:
    """JPEG of an image (h, w, 3) in OpenCV's order: blue, green, red."""
    _, data = cv2.imencode(".jpg", image, (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY))
    content: bytes = data.tobytes()
    return content
