"""The gripper: its action, as control_msgs/GripperCommand has it, and its state. Positions are between the jaws."""

from __future__ import annotations

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason


class GripperCommandGoal(Message, frozen=True, kw_only=True):
    """Open or close to `position`."""

    position: float = 0.0  # [m]
    max_effort: float = 0.0  # [N] that the gripper's own may not exceed; 0 is no bound


class GripperCommandFeedback(Message, frozen=True, kw_only=True):
    """How far it is, 10 times a second."""

    stamp: int = 0  # [ns] UNIX time
    position: float = 0.0  # [m]
    effort: float = 0.0  # [N] by the data sheet while it presses, else 0
    stalled: bool = False
    reached_goal: bool = False


class GripperCommandResult(Message, frozen=True, kw_only=True):
    """How it ended; a gripper that something keeps from its goal has stalled, and succeeded in gripping it."""

    position: float = 0.0  # [m]
    effort: float = 0.0  # [N] by the data sheet while it presses, else 0
    stalled: bool = False  # it stands before its goal and presses
    reached_goal: bool = False
    measured: bool = False  # a sensor reads the opening; False: position is what was commanded
    error_string: str = ""
    why: Reason | None = None  # `error_string` as data


class GripperState(Message, frozen=True, kw_only=True):
    """The gripper, 10 times a second, while the device is there."""

    stamp: int = 0  # [ns] UNIX time
    known: bool = False  # False: not measured, and not commanded since the device started
    measured: bool = False
    position: float = 0.0  # [m]
    target: float = 0.0  # [m]
    moving: bool = False
    stalled: bool = False
    effort: float = 0.0  # [N]
