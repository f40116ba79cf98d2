"""Transforms between frames, and the robot's description."""

from __future__ import annotations

from gemelo.schemas.message import Message, Vector


class Transform(Message, frozen=True, kw_only=True):
    """A rigid transform: `translation` (3,) and unit quaternion `rotation` (x, y, z, w)."""

    translation: Vector = (0.0, 0.0, 0.0)  # [m]
    rotation: Vector = (0.0, 0.0, 0.0, 1.0)  # (x, y, z, w)


class FrameTransform(Message, frozen=True, kw_only=True):
    """The pose of frame `child` in frame `parent` at `stamp`."""

    stamp: int = 0  # [ns] UNIX time
    parent: str = ""
    child: str = ""
    transform: Transform = Transform()


class FrameTransforms(Message, frozen=True, kw_only=True):
    """Several frames at once: all moving ones, or all static ones."""

    transforms: tuple[FrameTransform, ...] = ()


class RobotDescription(Message, frozen=True, kw_only=True):
    """The robot as its own files say it: text of URDF, SRDF and robot.toml."""

    robot: str = ""
    urdf: str = ""
    srdf: str = ""
    robot_toml: str = ""
