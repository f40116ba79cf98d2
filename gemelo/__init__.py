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
    from gemelo.api.arguments import Target, ToolGoal
    from gemelo.api.arm import Arm
    from gemelo.api.connection import connect, robots
    from gemelo.api.control import Control, Hold
    from gemelo.api.device import Device
    from gemelo.api.errors import Aborted, BadArgument, Canceled, Error, Interrupted, Lost, Refused
    from gemelo.api.gripping import Gripped
    from gemelo.api.homing_report import HomingProgress, HomingReport
    from gemelo.api.ledger import JointLedger, Ledger
    from gemelo.api.motion import Motion
    from gemelo.api.picking import Picked
    from gemelo.api.planning import Configurations, Plan
    from gemelo.api.robot_files import Robot, load_robot
    from gemelo.api.scene import Scene
    from gemelo.api.scene_files import load_mesh
    from gemelo.api.seeing import Seen
    from gemelo.api.simulation import SimulatedArm, SimulatedArms, SimulatedWorld, Simulation, simulate
    from gemelo.api.units import Pose, deg, mm
    from gemelo.api.verification import Verification
    from gemelo.libraries.runtime.node import Node
    from gemelo.schemas import planners, topics
    from gemelo.schemas.actions import GoalStatusCode
    from gemelo.schemas.device import DeviceMode, StopKind

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
    "planners",
    "robots",
    "simulate",
    "topics",
]

# Each name is imported when it is first used: a program that needs one part, as the command line, loads no other.
MODULES = {
    "gemelo.api.arguments": ("Target", "ToolGoal"),
    "gemelo.api.arm": ("Arm",),
    "gemelo.api.connection": ("connect", "robots"),
    "gemelo.api.control": ("Control", "Hold"),
    "gemelo.api.device": ("Device",),
    "gemelo.api.errors": ("Aborted", "BadArgument", "Canceled", "Error", "Interrupted", "Lost", "Refused"),
    "gemelo.api.gripping": ("Gripped",),
    "gemelo.api.homing_report": ("HomingProgress", "HomingReport"),
    "gemelo.api.ledger": ("JointLedger", "Ledger"),
    "gemelo.api.motion": ("Motion",),
    "gemelo.api.picking": ("Picked",),
    "gemelo.api.planning": ("Configurations", "Plan"),
    "gemelo.api.robot_files": ("Robot", "load_robot"),
    "gemelo.api.scene": ("Scene",),
    "gemelo.api.scene_files": ("load_mesh",),
    "gemelo.api.seeing": ("Seen",),
    "gemelo.api.simulation": ("SimulatedArm", "SimulatedArms", "SimulatedWorld", "Simulation", "simulate"),
    "gemelo.api.units": ("Pose", "deg", "mm"),
    "gemelo.api.verification": ("Verification",),
    "gemelo.schemas.actions": ("GoalStatusCode",),
    "gemelo.schemas.device": ("DeviceMode", "StopKind"),
    "gemelo.libraries.runtime.node": ("Node",),
}
TABLES = ("planners", "topics")  # modules of the schemas, whole
_MODULE_OF = {name: module for module, names in MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """The public name, from its module (PEP 562)."""
    if name in _MODULE_OF:
        value: object = getattr(import_module("gemelo.api.errors").imported(_MODULE_OF[name]), name)
    elif name in TABLES:
        value = import_module(f"gemelo.schemas.{name}")
    else:
        raise AttributeError(f"module 'gemelo' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
