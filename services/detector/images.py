"""Images of the bus as arrays."""

from __future__ import annotations

import cv2
import numpy as np

from gemelo.libraries.vision.boxes import ColourImage
from gemelo.schemas.camera import CameraImage


class NoPicture(ValueError):
    """The message does not hold the picture that it says it holds."""


def decoded(image: CameraImage) -> ColourImage:
    """(h, w, 3), red first; raises `NoPicture`."""
    match image.encoding:
        case "jpeg":
            found = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR_RGB) if image.data else None
            if found is None:
                raise NoPicture(f"an image of {len(image.data)} bytes is no JPEG")
            return np.asarray(found, dtype=np.uint8)
        case "rgb8" | "mono8" as encoding:
            channels = 3 if encoding == "rgb8" else 1
            if len(image.data) != image.width * image.height * channels:
                raise NoPicture(f"{len(image.data)} bytes are not {image.width} x {image.height} pixels of {encoding}")
            pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, channels)
            return np.broadcast_to(pixels, (image.height, image.width, 3))
        case _:
            raise NoPicture(f'the encoding "{image.encoding}" is none of jpeg, rgb8, mono8')
