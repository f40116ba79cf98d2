"""The cameras as they are drawn: the newest image of each, its frustum on the arm or the table, and what was found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.detections import Detection, Detections
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.event_log import clamp_stamp
from gemelo.services.visualizer.content.updates import Frustum, Labels, Outlines, PictureUpdate, Update
from gemelo.services.visualizer.model.visual_model import VisualModel

PICTURE_PERIOD = 200_000_000  # [ns] between two images of a camera in the view
FARTHEST = 1e6  # [m] or [px]: no thing is there, and beyond float32 the view's arithmetic overflows


@dataclass
class _ShownCamera:
    """What is known of one camera, and what of it has not been shown yet."""

    info: CameraInfo | None = None
    image: CameraImage | None = None
    found: Detections | None = None
    is_new: set[str] = field(default_factory=set)  # of the three names above
    shown_at: int = 0  # [ns]


class CameraView:
    """The newest messages of every camera, told anew only where they changed."""

    def __init__(self, model: VisualModel) -> None:
        self._model = model
        self._cameras: dict[str, _ShownCamera] = {}

    def on_info(self, message: CameraInfo) -> None:
        """The lens and the pose of a camera."""
        camera = self._camera(message.name)
        camera.info = message
        camera.is_new.add("info")

    def on_image(self, message: CameraImage) -> None:
        """The newest image of a camera; others than JPEG are left out."""
        if message.encoding == "jpeg" and message.data:
            camera = self._camera(message.camera)
            camera.image = message
            camera.is_new.add("image")

    def on_detections(self, message: Detections) -> None:
        """What was found in an image."""
        camera = self._camera(message.camera)
        camera.found = message
        camera.is_new.add("found")

    def restart(self) -> None:
        """Say everything again: the viewer is a new one."""
        for camera in self._cameras.values():
            camera.is_new = {"info", "image", "found"}
            camera.shown_at = 0

    def take(self, now: int) -> list[Update]:
        """The updates since the last call; `now` in [ns] UNIX."""
        now = clamp_stamp(now)
        updates: list[Update] = []
        for name, camera in self._cameras.items():
            if camera.info is not None and "info" in camera.is_new and self._has_place(camera.info):
                updates.append(self._frustum(camera.info, now))
            if camera.image is not None and "image" in camera.is_new:
                if now - camera.shown_at < PICTURE_PERIOD:
                    camera.is_new &= {"image", "found"}
                    continue
                camera.shown_at = now
                updates.append(PictureUpdate(entities.camera_picture(name), now, camera.image.data))
            if camera.found is not None and "found" in camera.is_new:
                updates += self._found(name, camera.found, now)
            camera.is_new = set()
        return updates

    def _camera(self, name: str) -> _ShownCamera:
        return self._cameras.setdefault(name, _ShownCamera())

    def _has_place(self, info: CameraInfo) -> bool:
        pose = info.parent_from_camera
        is_whole = len(pose.translation) == 3 and len(pose.rotation) == 4 and len(info.intrinsics) == 9
        return is_whole and info.parent in self._model.paths and min(info.width, info.height) > 0

    def _frustum(self, info: CameraInfo, now: int) -> Frustum:
        place = entities.camera_pose(self._model.paths[info.parent], info.name)
        pose = info.parent_from_camera
        size = info.width, info.height
        return Frustum(place, now, pose.translation, pose.rotation, info.intrinsics, size)

    def _found(self, name: str, found: Detections, now: int) -> list[Update]:
        """Outlines in the image; and a dot for each thing whose place in the base is known."""
        outlined = [each for each in found.items if _is_outline(each)]
        strips = tuple(np.array([*each.corners, each.corners[0]], dtype=float) for each in outlined)
        labels = tuple(f"{each.name} {_sigma(each)}" for each in outlined)
        located = [each for each in found.items if each.is_located and _is_place(each.base_from_thing.translation)]
        points = np.array([each.base_from_thing.translation for each in located], dtype=float).reshape(-1, 3)
        texts = tuple(f"{each.name} {_sigma(each)}" for each in located)
        return [
            Outlines(entities.found_in(name), now, strips, labels),
            Labels(entities.believed(name), now, points, texts),
        ]


def _is_outline(found: Detection) -> bool:
    return len(found.corners) > 1 and all(len(each) == 2 and _is_near(each) for each in found.corners)


def _is_place(point: Sequence[float]) -> bool:
    return len(point) == 3 and _is_near(point)


def _is_near(values: Sequence[float]) -> bool:
    return all(abs(value) < FARTHEST for value in values)


def _sigma(found: Detection) -> str:
    return f"± {found.sigma * 1e3:.2f} mm"
