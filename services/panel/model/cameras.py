"""The newest image of each camera of the cell, for the page."""

from __future__ import annotations

import time
from base64 import b64encode

import gemelo
from schemas.camera import CameraImage
from schemas.topics import camera_image

PERIOD = 0.5  # [s] between two images on the page
LARGEST = 600_000  # [bytes] of an image on the page: it goes to every browser again


class CameraPictures:
    """Images as they may stand in an <img>: data addresses; only of what was allowed to be shown as JPEG."""

    def __init__(self, arm: gemelo.Arm, cameras: tuple[str, ...]) -> None:
        self.names = cameras
        self._addresses: dict[str, str] = {}
        self._taken: dict[str, float] = {}  # [s] monotonic
        for name in cameras:
            arm.node.subscribe(camera_image(name), self._on_image)

    def address(self, camera: str) -> str:
        """Of the newest image; empty before the first."""
        return self._addresses.get(camera, "")

    def _on_image(self, image: CameraImage) -> None:
        now = time.monotonic()
        is_due = now - self._taken.get(image.camera, 0.0) >= PERIOD
        if is_due and image.camera in self.names and image.encoding == "jpeg" and len(image.data) <= LARGEST:
            self._taken[image.camera] = now
            self._addresses[image.camera] = f"data:image/jpeg;base64,{b64encode(image.data).decode()}"
