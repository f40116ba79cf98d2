"""An arm in Python: connect, move, plan, watch, and write nodes. Metres, radians and seconds everywhere.

    import gemelo

    with gemelo.connect() as arm:
        arm.home()
        arm.move(named="ready")
        arm.move(position=(0.25, 0.15, 0.10))
        arm.line(offset=(0, 0, -0.05), speed=0.03)

Whatever cannot be is an exception: `Refused` before anything moves, `Aborted` when a motion ends before its goal,
`Lost` when nobody answers. A motion never runs unwatched: when the script that started it ends, is interrupted or dies,
the arm decelerates on its path, unless the motion was started with `detached=True`.
"""

from __future__ import annotations

from gemelo.arm import Arm
from gemelo.connection import connect
from gemelo.device import Device
from gemelo.errors import Aborted, BadArgument, Canceled, Error, Interrupted, Lost, Refused
from gemelo.homing import HomingReport
from gemelo.motion import Motion
from gemelo.planning import Plan
from gemelo.scene import Scene
from gemelo.targets import Target, ToolGoal
from gemelo.units import Pose, deg, mm
from schemas import topics
from schemas.actions import GoalStatusCode
from schemas.device import DeviceMode, StopKind
from services.runtime.node import Node

__all__ = [
    "Aborted",
    "Arm",
    "BadArgument",
    "Canceled",
    "Device",
    "DeviceMode",
    "Error",
    "GoalStatusCode",
    "HomingReport",
    "Interrupted",
    "Lost",
    "Motion",
    "Node",
    "Plan",
    "Pose",
    "Refused",
    "Scene",
    "StopKind",
    "Target",
    "ToolGoal",
    "connect",
    "deg",
    "mm",
    "topics",
]
