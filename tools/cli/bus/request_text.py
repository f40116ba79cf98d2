"""Planning requests and refusals as text for a person: what was understood, and what can be typed instead."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from gemelo.api.planning import whole_reason
from gemelo.api.targets import usual_time
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    Goal,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    Refusal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.reasons import Reason, remedy
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.common.units import DEGREE, SHOWN

if TYPE_CHECKING:
    from gemelo import Refused
    from gemelo.libraries.arm.model.description import ArmDescription
    from gemelo.schemas.reasons import Reason


def request_text(request: PlanRequest, arm: ArmDescription) -> str:
    """A request as one line: `brazo_joint 30 deg; in a straight line of the joints; at 50 % speed`."""
    speed = f"at {100.0 * request.velocity_scaling:g} % speed" if request.velocity_scaling != 1.0 else ""
    timing = "without a jerk limit" if request.timing is Timing.TIME_OPTIMAL else ""
    points = len(request.goal.points) - 1 if isinstance(request.goal, WaypointGoal) else 0
    time = f"planned within {request.allowed_time:g} s" if request.allowed_time != usual_time(points) else ""
    clearance = "" if request.clearance is None else f"{1000.0 * request.clearance:g} mm from everything"
    return _joined([goal_text(request.goal, arm), motion_text(request.motion), speed, timing, clearance, time])


def goal_text(goal: Goal, arm: ArmDescription) -> str:
    """A goal in degrees and millimetres."""
    match goal:
        case NamedGoal():
            return f'to the named state "{goal.name}"'
        case JointGoal():
            return joints_text(goal.name, goal.position, arm)
        case PoseGoal():
            return _pose_text(goal)
        case WaypointGoal():
            blend = f"; corners cut within {millimetres([goal.blend])}" if goal.blend else ""
            return f"{', then '.join(goal_text(point, arm) for point in goal.points)}{blend}"


def joints_text(names: Iterable[str], values: Iterable[float], arm: ArmDescription, per: str = "") -> str:
    """`brazo_joint 30 deg, efector_joint 40 mm` from [rad] or [m]; `per` is appended to the unit, as "/s"."""
    shown = []
    for name, value in zip(names, values, strict=True):
        unit, factor = SHOWN[arm.joint(name).unit]
        shown.append(f"{name} {_number(value * factor)} {unit}{per}")
    return ", ".join(shown)


def millimetres(values: Iterable[float], per: str = "") -> str:
    """Lengths [m] as `250, 150, 100 mm`."""
    return f"{', '.join(_number(1e3 * value) for value in values)} mm{per}"


def degrees(values: Iterable[float], per: str = "") -> str:
    """Angles [rad] as `180, 0, 90 deg`."""
    return f"{', '.join(_number(value / DEGREE) for value in values)} deg{per}"


def motion_text(motion: Motion) -> str:
    """The kind of a motion and its limits; empty for a free motion without any."""
    match motion:
        case PointToPoint():
            return "in a straight line of the joints"
        case FreeMotion():
            seed = f"seed {motion.seed}" if motion.seed else ""
            attempts = f"{motion.attempts} attempts" if motion.attempts != 1 else ""
            return _joined([f"by {motion.planner_id}" if motion.planner_id else "", seed, attempts])
        case LinearMotion():
            return _joined(["the tool in a straight line", *_tool_limits(motion)])
        case CircularMotion():
            point = "about" if motion.center else "through"
            arc = f"the tool on an arc {point} {millimetres(motion.center or motion.interim)}"
            return _joined([arc, *_tool_limits(motion)])


def _pose_text(goal: PoseGoal) -> str:
    parts = [f"tool to {millimetres(goal.position)}"]
    if goal.frame:
        parts.append(f"in {goal.frame}")
    if goal.orientation:
        parts.append(f"turned {rotation_text(goal.orientation)}")
    if goal.tool_axis:
        parts.append(f"its axis {_direction(goal.tool_axis)} along {_direction(goal.direction)}")
    if goal.free_axis:
        parts.append(f"free about its axis {_direction(goal.free_axis)}")
    if goal.position_tolerance:
        parts.append(f"within {millimetres([goal.position_tolerance])}")
    if goal.orientation_tolerance:
        parts.append(f"within {degrees([goal.orientation_tolerance])}")
    return ", ".join(parts)


def rotation_text(rotation: Sequence[float]) -> str:
    """Angle [deg] and axis of a rotation (x, y, z, w) as text; `-` for none."""
    sine = math.hypot(*rotation[:3])
    angle = math.degrees(2.0 * math.atan2(sine, rotation[3]))
    if abs(angle) < 0.05:
        return "-"
    return f"{angle:.1f} deg about {' '.join(f'{value / sine:z.2f}' for value in rotation[:3])}"


def _tool_limits(motion: LinearMotion | CircularMotion) -> list[str]:
    return [
        f"at most {millimetres([motion.speed], '/s')}" if motion.speed else "",
        f"at most {millimetres([motion.acceleration], '/s2')}" if motion.acceleration else "",
        f"checked every {millimetres([motion.max_step])}" if motion.max_step else "",
        f"no joint jumping by more than {degrees([motion.jump_threshold])}" if motion.jump_threshold else "",
        f"at least {100.0 * motion.least_fraction:g} % of it" if motion.least_fraction != 1.0 else "",
    ]


def refusal_reason(refusal: Refusal, goal: Goal, arm: ArmDescription) -> Reason:
    """The reason, and the nearest goal that can be reached as options, else the remedies."""
    typed = as_typed(goal, refusal.nearest, arm) if refusal.nearest else ""
    return whole_reason(refusal, remedy("nearest_that_can", arguments=typed) if typed else None)


def refusal_error(error: Refused, goal: Goal, arm: ArmDescription) -> CommandError:
    """The end of a command whose `goal` was refused, in options where `gemelo` says arguments."""
    return CommandError(refusal_reason(error.refusal, goal, arm) if error.refusal is not None else error)


def as_typed(goal: Goal, values: Sequence[float], arm: ArmDescription) -> str:
    """`values` [m, rad] in the form of `goal`, as options of `gemelo move`."""
    if isinstance(goal, PoseGoal):
        turn = f" {'--along' if goal.tool_axis else '--quaternion'} {_numbers(values[3:], 6)}" if values[3:] else ""
        return f"--to {_numbers(values[:3], 4)}{turn}"
    names = goal.name if isinstance(goal, JointGoal) and len(goal.name) == len(values) else arm.joint_names
    return "--joints " + " ".join(_assignment(arm, name, value) for name, value in zip(names, values, strict=False))


def _joined(parts: Iterable[str]) -> str:
    return "; ".join(part for part in parts if part)


def _number(value: float) -> str:
    return f"{value:.7g}" if abs(value) >= 5e-8 else "0"


def _numbers(values: Sequence[float], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def _direction(values: Iterable[float]) -> str:
    return f"({', '.join(_number(value) for value in values)})"


def _assignment(arm: ArmDescription, name: str, value: float) -> str:
    shown, factor = SHOWN[arm.joint(name).unit]
    return f"{name}={value * factor:.6g}{shown}"
