"""The images of the cameras as Foxglove's viewers know them, a few a second. Pure but for the subscriptions.

Field names are those of the published schemas foxglove.CompressedImage, foxglove.CameraCalibration and
foxglove.FrameTransform.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from gemelo.libraries.recordings.foxglove import CAMERA, IMAGE
from gemelo.libraries.recordings.foxglove_schemas import Quaternion, Time, Vector3, time_of
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.camera import CameraImage, CameraInfo
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.topics import LATCHED, LATEST, Delivery, Topic, camera_image, camera_info

PERIOD_SLACK = 0.2  # of the time between two images: one that comes so much early counts as on time
SECOND = 1_000_000_000  # [ns]
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
EPOCH = Time(sec=0, nsec=0)


class CompressedImage(Message, frozen=True, kw_only=True):
    """A JPEG; in JSON its data are base64."""

    timestamp: Time = EPOCH
    frame_id: str = ""
    data: bytes = b""
    format: str = "jpeg"


class CameraCalibration(Message, frozen=True, kw_only=True):
    """The pinhole model: distortion D of the model "plumb_bob", K (3, 3), R (3, 3) and P (3, 4) row by row."""

    timestamp: Time = EPOCH
    frame_id: str = ""
    width: int = 0
    height: int = 0
    distortion_model: str = "plumb_bob"
    D: Vector = ()
    K: Vector = ()
    R: Vector = IDENTITY
    P: Vector = ()


class CameraFrame(Message, frozen=True, kw_only=True):
    """Where the camera is."""

    timestamp: Time = EPOCH
    parent_frame_id: str = ""
    child_frame_id: str = ""
    translation: Vector3 = Vector3(x=0.0, y=0.0, z=0.0)
    rotation: Quaternion = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)


# A channel's schema is named after the message's class, and a viewer knows these by their full names.
CompressedImage.__name__ = "foxglove.CompressedImage"
CameraCalibration.__name__ = "foxglove.CameraCalibration"
CameraFrame.__name__ = "foxglove.FrameTransform"

Recorded = tuple[Topic[Any], Message]
OnMessage = Callable[[Topic[Any], Message], None]


class CameraRecorder:
    """One camera's messages, thinned to a rate and as Foxglove has them."""

    def __init__(self, camera: str) -> None:
        key = CAMERA.format(camera)
        self._frame = f"camera_{camera}"
        self._image = _topic(f"{key}/{IMAGE}", CompressedImage, LATEST, "a few of its images a second")
        self._lens = _topic(f"{key}/calibration", CameraCalibration, LATCHED, "its lens")
        self._pose = _topic(f"{key}/frame", CameraFrame, LATCHED, "where it is")
        self._due = 0  # [ns] the stamp from which on the next image is recorded

    def on_image(self, message: CameraImage, rate: float) -> Iterator[Recorded]:
        """The image if it is time for one at `rate` [Hz]; others than JPEG are left out."""
        if rate <= 0.0 or message.encoding != "jpeg":
            return
        period = int(SECOND / rate)
        wait = self._due - message.stamp
        if PERIOD_SLACK * period < wait <= 2 * period:  # of a clock that was set back it is more
            return
        self._due = (self._due if abs(wait) < period else message.stamp) + period
        yield self._image, CompressedImage(timestamp=time_of(message.stamp), frame_id=self._frame, data=message.data)

    def on_info(self, message: CameraInfo, now: int) -> Iterator[Recorded]:
        """Lens and pose; `now` in [ns] UNIX."""
        at, k = time_of(now), message.intrinsics
        if len(k) == 9:
            yield (
                self._lens,
                CameraCalibration(
                    timestamp=at,
                    frame_id=self._frame,
                    width=message.width,
                    height=message.height,
                    D=message.distortion or (0.0,) * 5,
                    K=k,
                    P=(k[0], k[1], k[2], 0.0, k[3], k[4], k[5], 0.0, k[6], k[7], k[8], 0.0),
                ),
            )
        pose = message.parent_from_camera
        if len(pose.translation) == 3 and len(pose.rotation) == 4:
            (x, y, z), (a, b, c, d) = pose.translation, pose.rotation
            place, turn = Vector3(x=x, y=y, z=z), Quaternion(x=a, y=b, z=c, w=d)
            frames = {"parent_frame_id": message.parent, "child_frame_id": self._frame}
            yield self._pose, CameraFrame(timestamp=at, translation=place, rotation=turn, **frames)


def record_cameras(node: Node, cameras: Sequence[str], rate: Callable[[], float], on_message: OnMessage) -> None:
    """Hands what is to be recorded of the cameras to `on_message`; `rate()` [Hz] of the images."""
    for name in cameras:
        _record(node, name, rate, on_message)


def _record(node: Node, name: str, rate: Callable[[], float], on_message: OnMessage) -> None:
    recorder = CameraRecorder(name)

    def on_image(message: CameraImage) -> None:
        for topic, recorded in recorder.on_image(message, rate()):
            on_message(topic, recorded)

    def on_info(message: CameraInfo) -> None:
        for topic, recorded in recorder.on_info(message, node.now()):
            on_message(topic, recorded)

    node.subscribe(camera_image(name), on_image)
    node.subscribe(camera_info(name), on_info)


def _topic(key: str, kind: type[Message], delivery: Delivery, about: str) -> Topic[Any]:
    return Topic(key, kind, delivery, None, True, "logger", about)
