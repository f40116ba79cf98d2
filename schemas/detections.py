"""Things that a detector has found in one image, each with its pose and how sure that is."""

from __future__ import annotations

from enum import StrEnum

from gemelo.schemas.frames import Transform
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason


class DetectionKind(StrEnum):
    """How a thing was found."""

    TAG = "tag"
    BOX = "box"
    COLOUR = "colour"
    ONNX = "onnx"


class Detection(Message, frozen=True, kw_only=True):
    """One thing in one image."""

    name: str = ""  # of the thing in the cell file; of a tag that is no thing: "tag <id>"
    kind: DetectionKind = DetectionKind.TAG
    corners: tuple[Vector, ...] = ()  # (n, 2) [px] its outline in the image, in order, distorted as the image is
    camera_from_thing: Transform = Transform()
    base_from_thing: Transform = Transform()
    is_located: bool = False  # False: where the camera stands is not known, so `base_from_thing` is not either
    sigma: float = 0.0  # [m] standard deviation of its position
    flip_ratio: float = 0.0  # reprojection error of the better over that of the other pose: 1 cannot be told apart


class Unclear(Message, frozen=True, kw_only=True):
    """Something in one image that may be a thing, and cannot be measured."""

    names: tuple[str, ...] = ()  # of the things in the cell file that it may be
    corners: tuple[Vector, ...] = ()  # (4, 2) [px] of the rectangle around it, in order
    reason: str = ""  # why it is not taken for any of them
    why: Reason | None = None  # `reason` as data


class Detections(Message, frozen=True, kw_only=True):
    """Everything that was found in one image; with no items nothing was."""

    stamp: int = 0  # [ns] UNIX time of the image
    camera: str = ""
    items: tuple[Detection, ...] = ()
    unclear: tuple[Unclear, ...] = ()
    doubt: str = ""  # why places in the base frame are not to be trusted; empty: nothing speaks against them
    doubt_why: Reason | None = None  # `doubt` as data
