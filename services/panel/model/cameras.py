"""The newest image of each camera of the cell, and what was detected in it, for the page."""

from __future__ import annotations

import time
from base64 import b64encode
from collections.abc import Collection
from dataclasses import dataclass

import gemelo
from gemelo.schemas.camera import CameraImage
from gemelo.schemas.detections import Detection, Detections
from gemelo.schemas.topics import camera_detections, camera_image
from gemelo.services.panel.model.pointing import NEAR, Pointed, pointed_at

PERIOD = 0.5  # [s] between two images on the page
LARGEST = 600_000  # [bytes] of an image on the page: it goes to every browser again
AGED = 2_000_000_000  # [ns] chosen: what was detected so long before the image is not drawn into it


@dataclass(frozen=True)
class Picture:
    """An image as it may stand in an <img>, and what was detected in it or shortly before."""

    address: str = ""  # of data; empty before the first image
    width: int = 0  # [px]
    height: int = 0
    stamp: int = 0  # [ns] UNIX time of the image
    items: tuple[Detection, ...] = ()


NONE = Picture()


class CameraPictures:
    """Of the cell's own cameras; only of what was allowed to be shown as JPEG. Any thread may call it."""

    def __init__(self, arm: gemelo.Arm, cameras: tuple[str, ...], period: float = PERIOD) -> None:
        """`period` [s] is the shortest between two images of a camera."""
        self.names, self._period = cameras, period
        self._pictures: dict[str, Picture] = {}
        self._detections: dict[str, Detections] = {}
        self._taken: dict[str, float] = {}  # [s] monotonic
        for name in cameras:
            arm.node.subscribe(camera_image(name), self._on_image)
            arm.node.subscribe(camera_detections(name), self._on_detections)

    def picture(self, camera: str) -> Picture:
        """The newest."""
        return self._pictures.get(camera, NONE)

    def pointed_at(self, camera: str, x: float, y: float, things: Collection[str]) -> Pointed:
        """What is meant by a place in its image: `x` and `y` are shares, 0 to 1, from the upper left corner."""
        picture = self.picture(camera)
        return pointed_at(
            self._items(camera, picture.stamp), things, (x * picture.width, y * picture.height), NEAR * picture.width
        )

    def _items(self, camera: str, stamp: int) -> tuple[Detection, ...]:
        """The newest detections, unless they are much older than an image of `stamp` [ns]."""
        found = self._detections.get(camera)
        return found.items if found is not None and stamp - found.stamp < AGED else ()

    def _on_detections(self, found: Detections) -> None:
        if found.camera in self.names:
            self._detections[found.camera] = found

    def _on_image(self, image: CameraImage) -> None:
        now = time.monotonic()
        is_due = now - self._taken.get(image.camera, 0.0) >= self._period
        if is_due and image.camera in self.names and image.encoding == "jpeg" and len(image.data) <= LARGEST:
            self._taken[image.camera] = now
            address = f"data:image/jpeg;base64,{b64encode(image.data).decode()}"
            items = self._items(image.camera, image.stamp)
            self._pictures[image.camera] = Picture(address, image.width, image.height, image.stamp, items)
