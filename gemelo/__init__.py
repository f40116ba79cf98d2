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

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gemelo.arguments import Target, ToolGoal
    from gemelo.arm import Arm
    from gemelo.connection import connect, robots
    from gemelo.control import Control, Hold
    from gemelo.device import Device
    from gemelo.errors import Aborted, BadArgument, Canceled, Error, Interrupted, Lost, Refused
    from gemelo.gripping import Gripped
    from gemelo.homing_report import HomingProgress, HomingReport
    from gemelo.ledger import JointLedger, Ledger
    from gemelo.motion import Motion
    from gemelo.picking import Picked
    from gemelo.planning import Configurations, Plan
    from gemelo.robot_files import Robot, load_robot
    from gemelo.scene import Scene
    from gemelo.scene_files import load_mesh
    from gemelo.seeing import Seen
    from gemelo.simulation import SimulatedArm, SimulatedArms, SimulatedWorld, Simulation, simulate
    from gemelo.units import Pose, deg, mm
    from gemelo.verification import Verification
    from schemas import topics
    from schemas.actions import GoalStatusCode
    from schemas.device import DeviceMode, StopKind
    from services.runtime.node import Node

__all__ = [
    "Aborted",
    "Arm",
    "BadArgument",
    "Canceled",
    "Configurations",
    "Control",
    "Device",
    "DeviceMode",
    "Error",
    "GoalStatusCode",
    "Gripped",
    "Hold",
    "HomingProgress",
    "HomingReport",
    "Interrupted",
    "JointLedger",
    "Ledger",
    "Lost",
    "Motion",
    "Node",
    "Picked",
    "Plan",
    "Pose",
    "Refused",
    "Robot",
    "Scene",
    "Seen",
    "SimulatedArm",
    "SimulatedArms",
    "SimulatedWorld",
    "Simulation",
    "StopKind",
    "Target",
    "ToolGoal",
    "Verification",
    "connect",
    "deg",
    "load_mesh",
    "load_robot",
    "mm",
    "robots",
    "simulate",
    "topics",
]

# Each name is imported when it is first used: a program that needs one part, as the command line, loads no other.
MODULES = {
    "gemelo.arguments": ("Target", "ToolGoal"),
    "gemelo.arm": ("Arm",),
    "gemelo.connection": ("connect", "robots"),
    "gemelo.control": ("Control", "Hold"),
    "gemelo.device": ("Device",),
    "gemelo.errors": ("Aborted", "BadArgument", "Canceled", "Error", "Interrupted", "Lost", "Refused"),
    "gemelo.gripping": ("Gripped",),
    "gemelo.homing_report": ("HomingProgress", "HomingReport"),
    "gemelo.ledger": ("JointLedger", "Ledger"),
    "gemelo.motion": ("Motion",),
    "gemelo.picking": ("Picked",),
    "gemelo.planning": ("Configurations", "Plan"),
    "gemelo.robot_files": ("Robot", "load_robot"),
    "gemelo.scene": ("Scene",),
    "gemelo.scene_files": ("load_mesh",),
    "gemelo.seeing": ("Seen",),
    "gemelo.simulation": ("SimulatedArm", "SimulatedArms", "SimulatedWorld", "Simulation", "simulate"),
    "gemelo.units": ("Pose", "deg", "mm"),
    "gemelo.verification": ("Verification",),
    "schemas.actions": ("GoalStatusCode",),
    "schemas.device": ("DeviceMode", "StopKind"),
    "services.runtime.node": ("Node",),
}
_MODULE_OF = {name: module for module, names in MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """The public name, from its module (PEP 562)."""
    if name in _MODULE_OF:
        value: object = getattr(import_module(_MODULE_OF[name]), name)
    elif name == "topics":
        value = import_module("schemas.topics")
    else:
        raise AttributeError(f"module 'gemelo' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
