"""The source that renders: exact poses in, an image as a cheap webcam would give it out, and the truth beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import cv2
import numpy as np

from gemelo.libraries.arm.frames.transforms import Rigid, compose, from_message, inverse, rotate, to_message
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import CameraRecord, TagThing, Thing, VirtualSource
from gemelo.schemas.detections import Detection, DetectionKind, Detections
from gemelo.services.camera.sources.source import EncodedImage, encoded
from gemelo.services.camera.virtual.render import Image, Optics, expose, render
from gemelo.services.camera.virtual.world import WorldSnapshot

FRESH = 500_000_000  # [ns] a joint state that is older says nothing of the time of an image


class VirtualCamera:
    """Renders what `look` gives; of a world that stands still only the noise is made anew."""

    is_live = False

    def __init__(
        self,
        record: CameraRecord,
        source: VirtualSource,
        info: CameraInfo,
        look: Callable[[], WorldSnapshot],
        clock: Clock = SYSTEM,
    ) -> None:
        """`info` is exact, whatever is believed of the camera."""
        self.period = 1.0 / record.fps
        self._info, self._look, self._clock = info, look, clock
        self._optics = Optics(samples=source.samples, blur=source.blur, noise=source.noise)
        self.calm: tuple[object, Image] | None = None  # the newest image without noise, and of what
        self._count = 0

    def open(self) -> None:
        pass

    def read(self) -> EncodedImage:
        """The image of this moment; it has the joint state's stamp, since that is the instant that it shows."""
        snapshot = self._look()
        now = self._clock.unix()
        image = self.image(snapshot)
        stamp = snapshot.stamp if 0 <= now - snapshot.stamp <= FRESH else now
        return EncodedImage(stamp, self._info.width, self._info.height, encoded(cv2.cvtColor(image, cv2.COLOR_RGB2BGR)))

    def close(self) -> None:
        pass

    def image(self, snapshot: WorldSnapshot) -> Image:
        """(h, w, 3) in red, green, blue."""
        pose = base_from_camera(self._info, snapshot.links)
        key = (snapshot.key, pose)
        if self.calm is None or self.calm[0] != key:
            self.calm = key, render(snapshot.solids, self._info, pose, replace(self._optics, noise=0.0))
        self._count += 1
        grain = Optics(blur=0.0, noise=self._optics.noise)
        return expose(self.calm[1], grain, self._count)


def base_from_camera(info: CameraInfo, links: Mapping[str, Rigid]) -> Rigid:
    """The optical frame in the base; the base frame is among the `links`."""
    return compose(links[info.parent], from_message(info.parent_from_camera))


def true_detections(snapshot: WorldSnapshot, info: CameraInfo, things: Mapping[str, Thing]) -> Detections:
    """Every thing that stands somewhere, seen or not, exactly where it is: what a detector is judged by."""
    pose = base_from_camera(info, snapshot.links)
    items = []
    for name, thing_pose in snapshot.things.items():
        thing, local = things[name], compose(inverse(pose), thing_pose)
        items.append(
            Detection(
                name=name,
                kind=DetectionKind(str(thing.__struct_config__.tag)),
                corners=projected(outline(thing), local, info),
                camera_from_thing=to_message(local),
                base_from_thing=to_message(thing_pose),
                is_located=True,
            )
        )
    return Detections(stamp=snapshot.stamp, camera=info.name, items=tuple(items))


def outline(thing: Thing) -> tuple[tuple[float, float, float], ...]:
    """(4, 3) [m] in its frame: the tag's corners, or those of the box's upper face; from the top left, clockwise."""
    if isinstance(thing, TagThing):
        x, y, z = thing.size / 2.0, thing.size / 2.0, 0.0
    else:
        x, y, z = (edge / 2.0 for edge in thing.box)
    return (-x, y, z), (x, y, z), (x, -y, z), (-x, -y, z)


def projected(
    points: tuple[tuple[float, float, float], ...], pose: Rigid, info: CameraInfo
) -> tuple[tuple[float, ...], ...]:
    """(n, 2) [px] of points [m] in a frame whose pose in the optical frame is given; empty where one is behind it."""
    placed = [tuple(a + b for a, b in zip(rotate(pose[1], point), pose[0], strict=True)) for point in points]
    if any(point[2] <= 0.0 for point in placed):
        return ()
    matrix = np.array(info.intrinsics).reshape(3, 3)
    distortion = np.array(info.distortion or (0.0,) * 5)
    found = cv2.projectPoints(np.array(placed), np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)
    return tuple(tuple(row) for row in found.tolist())
