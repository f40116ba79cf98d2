"""The messages of Foxglove's published schemas that a recording has, field for field; units m, s, and colours 0 to 1.

Names and fields are those of `foxglove.FrameTransforms`, `foxglove.Log` and `foxglove.SceneUpdate` in JSON. Fields that
the published schemas do not require (identifiers of messages, lineage) are left out.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import msgspec

from gemelo.libraries.recordings.channels import LAST_STAMP

Empty = tuple[Any, ...]  # of primitives that are never drawn here


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """Every field is required, as in the published schemas."""


class Time(Record, frozen=True):
    """A UNIX time."""

    sec: int
    nsec: int  # below 10^9


def time_of(stamp: int) -> Time:
    """The time of `stamp` [ns] UNIX."""
    sec, nsec = divmod(min(max(stamp, 0), LAST_STAMP), 1_000_000_000)
    return Time(sec=sec, nsec=nsec)


class Duration(Record, frozen=True):
    sec: int = 0
    nsec: int = 0


class Vector3(Record, frozen=True):
    x: float
    y: float
    z: float


class Quaternion(Record, frozen=True):
    x: float
    y: float
    z: float
    w: float


class Pose(Record, frozen=True):
    position: Vector3
    orientation: Quaternion


class Color(Record, frozen=True):
    r: float
    g: float
    b: float
    a: float


class FrameTransform(Record, frozen=True):
    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(Record, frozen=True):
    transforms: tuple[FrameTransform, ...]


class LogLevel(IntEnum):
    UNKNOWN = 0
    DEBUG = 1
    INFO = 2
    WARNING = 3
    ERROR = 4
    FATAL = 5


class Log(Record, frozen=True):
    timestamp: Time
    level: LogLevel
    message: str
    name: str  # of the node
    file: str = ""
    line: int = 0


class DeletionType(IntEnum):
    MATCHING_ID = 0
    ALL = 1


class SceneEntityDeletion(Record, frozen=True):
    timestamp: Time
    type: DeletionType
    id: str


class KeyValuePair(Record, frozen=True):
    key: str
    value: str


class CubePrimitive(Record, frozen=True):
    pose: Pose
    size: Vector3
    color: Color


class SpherePrimitive(Record, frozen=True):
    """An ellipsoid in a box of `size`."""

    pose: Pose
    size: Vector3
    color: Color


class CylinderPrimitive(Record, frozen=True):
    """A cylinder along z in a box of `size`; the scales are 1 where it is no cone."""

    pose: Pose
    size: Vector3
    bottom_scale: float
    top_scale: float
    color: Color


class TriangleListPrimitive(Record, frozen=True):
    """Three points for each triangle, in order."""

    pose: Pose
    points: tuple[Vector3, ...]
    color: Color
    colors: tuple[Color, ...] = ()
    indices: tuple[int, ...] = ()


class SceneEntity(Record, frozen=True):
    """Shapes in the frame `frame_id`, which they follow as it moves where `frame_locked`."""

    timestamp: Time
    frame_id: str
    id: str
    lifetime: Duration = Duration()
    frame_locked: bool = True
    metadata: tuple[KeyValuePair, ...] = ()
    arrows: Empty = ()
    cubes: tuple[CubePrimitive, ...] = ()
    spheres: tuple[SpherePrimitive, ...] = ()
    cylinders: tuple[CylinderPrimitive, ...] = ()
    lines: Empty = ()
    triangles: tuple[TriangleListPrimitive, ...] = ()
    texts: Empty = ()
    models: Empty = ()


class SceneUpdate(Record, frozen=True):
    deletions: tuple[SceneEntityDeletion, ...]
    entities: tuple[SceneEntity, ...]
