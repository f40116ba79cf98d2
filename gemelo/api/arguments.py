"""The arguments that say where to: the types of `move`, `plan`, `start`, `line`, `arc`, `path` and `ik`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TypedDict

from gemelo.api.units import Pose

Joints = Mapping[str, float] | Sequence[float]
Vector = Sequence[float]
Grip = str | float  # "open", "close", or [m] between the jaws
Waypoint = str | Mapping[str, float] | Pose | Vector


class ToolGoal(TypedDict, total=False):
    """Where the tool is to be; what is left out does not matter."""

    position: Vector  # (3,) [m] in `frame`
    orientation: Vector  # unit quaternion (x, y, z, w) in `frame`
    rpy: Vector  # (3,) [rad] the same as roll, pitch and yaw about the fixed axes of `frame`
    pose: Pose  # position and orientation at once
    offset: Vector  # (3,) [m] from where the tool is now, along the axes of `frame`; it stays turned as it is
    axis: Vector  # (3,) of the tool, to point along `along`; its z if left out
    along: Vector  # (3,) direction in `frame`
    free_axis: Vector  # (3,) of the tool: turning about it does not matter
    frame: str  # a link in which all this is given, as it is now; the base if left out
    position_tolerance: float  # [m] exact if left out
    orientation_tolerance: float  # [rad] exact if left out


class Target(ToolGoal, total=False):
    """Where to, on which path, and how fast: the arguments of `move`, `plan` and `start`. One goal is needed."""

    named: str  # a named state of the SRDF
    joints: Joints  # [rad] or [m] by name, the others stay; or all, in the arm's order
    line: bool  # the tool on a straight line
    ptp: bool  # the joints on a straight line
    through: Vector  # (3,) [m] in `frame`: the tool on an arc through this point
    center: Vector  # (3,) [m] in `frame`: the tool on the shorter arc about this point
    via: Iterable[Waypoint]  # to be passed before the goal: positions [m], poses, named states, joints by name
    blend: float  # [m] around each of them within which the corner may be cut
    speed: float  # share of the joints' velocity limits, in (0, 1]
    acceleration: float  # share of their acceleration limits, in (0, 1]; as `speed` if left out
    tool_speed: float  # [m/s] at most, on a line or an arc
    tool_acceleration: float  # [m/s^2] at most, on a line or an arc
    least_fraction: float  # of a line or an arc that will do, in (0, 1]
    max_step: float  # [m] between two checked points of a line or an arc
    jump: float  # [rad] or [m] that a joint may move between them
    planner: str  # one of `gemelo.planners.NAMES`; docs/planners.md says what each can do
    seed: int  # the same seed, the same plan
    attempts: int  # 1 to 1000: as many times as usual is looked for a shorter way, within `allowed_time`
    time_optimal: bool  # as fast as can be, without a limit of the jerk
    clearance: float  # [m] that stays free between what may not touch, 0.5 mm to 50 mm; the robot's own if left out
    allowed_time: float  # [s] for planning
    from_joints: Joints  # plan from there; from where the arm is if left out
