"""Cameras: images, what maps their pixels to rays, and how each camera is."""

from __future__ import annotations

from enum import StrEnum

from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason


class CameraImage(Message, frozen=True, kw_only=True):
    """One image, as it was taken or rendered."""

    stamp: int = 0  # [ns] UNIX time of capture
    camera: str = ""
    width: int = 0  # [px]
    height: int = 0  # [px]
    encoding: str = "jpeg"  # "jpeg"; or "rgb8", "mono8": rows from the top, without padding
    data: bytes = b""


class CameraInfo(Message, frozen=True, kw_only=True):
    """The pinhole model with OpenCV's distortion, and where the camera stands.

    The optical frame has z forward, x right in the image and y down; a pixel's centre has whole coordinates.
    """

    name: str = ""
    width: int = 0  # [px]
    height: int = 0  # [px]
    intrinsics: Vector = ()  # [px] the matrix K (3, 3) row by row
    distortion: Vector = ()  # k1, k2, p1, p2, k3 of OpenCV's model; empty: none
    parent: str = ""  # the frame that carries the camera: the base or a link; empty: not known
    parent_from_camera: Transform = Transform()  # the pose of the optical frame in `parent`
    is_mounted: bool = False  # True: `parent_from_camera` is measured or exact, not the default
    is_calibrated: bool = False  # True: `intrinsics` are measured or exact, not assumed from a field of view
    date: str = ""  # of the calibration, ISO 8601; empty: never


class CameraCondition(StrEnum):
    """Whether images come, and if not, why."""

    STARTING = "starting"
    STREAMING = "streaming"
    MISSING = "missing"  # there is no such device, file or folder
    TAKEN = "taken"  # another program has it
    UNPLUGGED = "unplugged"  # it was there and is gone
    FROZEN = "frozen"  # it is there and gives no new image
    REFUSED = "refused"  # it does not do what the cell file asks: size, focus, exposure
    ENDED = "ended"  # a file or folder that is played once is at its end


class CameraStatus(Message, frozen=True, kw_only=True):
    """How one camera is, at every change and once a second."""

    stamp: int = 0  # [ns] UNIX time
    camera: str = ""
    condition: CameraCondition = CameraCondition.STARTING
    text: str = ""  # what is wrong and the remedy; empty while it streams
    fps: float = 0.0  # [Hz] images of the last second
    why: Reason | None = None  # `text` as data
