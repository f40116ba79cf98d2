"""Images of the bus as arrays."""

from __future__ import annotations

import cv2
import numpy as np

from gemelo.libraries.vision.boxes import ColourImage
from gemelo.schemas.camera import CameraImage
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Value, because


class NoPicture(ReasonedError, ValueError):
    """The message does not hold the picture that it says it holds."""


def decoded(image: CameraImage) -> ColourImage:
    """(h, w, 3), red first; raises `NoPicture`."""
    match image.encoding:
        case "jpeg":
            found = cv2.imdecode(np.frombuffer(image.data, np.uint8), cv2.IMREAD_COLOR_RGB) if image.data else None
            if found is None:
                raise NoPicture(because("detect.image.jpeg", size=len(image.data)))
            return np.asarray(found, dtype=np.uint8)
        case "rgb8" | "mono8" as encoding:
            channels = 3 if encoding == "rgb8" else 1
            if len(image.data) != image.width * image.height * channels:
                about: dict[str, Value] = {"width": image.width, "height": image.height, "encoding": encoding}
                raise NoPicture(because("detect.image.pixels", size=len(image.data), **about))
            pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, channels)
            return np.broadcast_to(pixels, (image.height, image.width, 3))
        case _:
            raise NoPicture(because("detect.image.encoding", encoding=image.encoding))
