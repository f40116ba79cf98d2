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
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.units import DEGREE, SHOWN

if TYPE_CHECKING:
    from gemelo import Refused
    from gemelo.libraries.arm.model.description import ArmDescription


def understood(text: str) -> str:
    """What a command says first, before it asks the stack."""
    return sentence(because("understood", text=text))


def request_text(request: PlanRequest, arm: ArmDescription) -> str:
    """A request as one line: `brazo_joint 30 deg; in a straight line of the joints; at 50 % speed`."""
    speed = request.velocity_scaling
    points = len(request.goal.points) - 1 if isinstance(request.goal, WaypointGoal) else 0
    parts = [
        because("understood.speed", speed=100.0 * speed) if speed != 1.0 else None,
        because("understood.time_optimal") if request.timing is Timing.TIME_OPTIMAL else None,
        None if request.clearance is None else because("understood.clearance", distance=1e3 * request.clearance),
        because("understood.time", time=request.allowed_time) if request.allowed_time != usual_time(points) else None,
    ]
    return _joined([goal_text(request.goal, arm), motion_text(request.motion), *map(_said, parts)])


def goal_text(goal: Goal, arm: ArmDescription) -> str:
    """A goal in degrees and millimetres."""
    match goal:
        case NamedGoal():
            return sentence(because("understood.named", name=goal.name))
        case JointGoal():
            return joints_text(goal.name, goal.position, arm)
        case PoseGoal():
            return _pose_text(goal)
        case WaypointGoal():
            first, *rest = (goal_text(point, arm) for point in goal.points)
            path = ", ".join([first, *(sentence(because("understood.then", text=text)) for text in rest)])
            if not goal.blend:
                return path
            return _joined([path, sentence(because("understood.blend", distance=millimetres([goal.blend])))])


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
            return sentence(because("understood.ptp"))
        case FreeMotion():
            parts = [
                because("understood.planner", name=motion.planner_id) if motion.planner_id else None,
                because("understood.seed", seed=motion.seed) if motion.seed else None,
                because("understood.attempts", count=motion.attempts) if motion.attempts != 1 else None,
            ]
            return _joined(map(_said, parts))
        case LinearMotion():
            return _joined(map(_said, (because("understood.line"), *_tool_limits(motion))))
        case CircularMotion():
            code = "understood.arc.about" if motion.center else "understood.arc.through"
            arc = because(code, point=millimetres(motion.center or motion.interim))
            return _joined(map(_said, (arc, *_tool_limits(motion))))


def _pose_text(goal: PoseGoal) -> str:
    parts = [because("understood.tool", position=millimetres(goal.position))]
    if goal.frame:
        parts.append(because("understood.frame", frame=goal.frame))
    if goal.orientation:
        parts.append(because("understood.turned", turn=rotation_text(goal.orientation)))
    if goal.tool_axis:
        axis, along = _direction(goal.tool_axis), _direction(goal.direction)
        parts.append(because("understood.axis", axis=axis, along=along))
    if goal.free_axis:
        parts.append(because("understood.free_axis", axis=_direction(goal.free_axis)))
    if goal.position_tolerance:
        parts.append(because("understood.within", distance=millimetres([goal.position_tolerance])))
    if goal.orientation_tolerance:
        parts.append(because("understood.within", distance=degrees([goal.orientation_tolerance])))
    return ", ".join(map(sentence, parts))


def rotation_text(rotation: Sequence[float]) -> str:
    """Angle [deg] and axis of a rotation (x, y, z, w) as text; `-` for none."""
    sine = math.hypot(*rotation[:3])
    angle = math.degrees(2.0 * math.atan2(sine, rotation[3]))
    if abs(angle) < 0.05:
        return "-"
    axis = " ".join(f"{value / sine:z.2f}" for value in rotation[:3])
    return sentence(because("understood.rotation", angle=angle, axis=axis))


def _tool_limits(motion: LinearMotion | CircularMotion) -> list[Reason | None]:
    least = motion.least_fraction
    return [
        because("understood.at_most", limit=millimetres([motion.speed], "/s")) if motion.speed else None,
        because("understood.at_most", limit=millimetres([motion.acceleration], "/s2")) if motion.acceleration else None,
        because("understood.checked", step=millimetres([motion.max_step])) if motion.max_step else None,
        because("understood.jump", angle=degrees([motion.jump_threshold])) if motion.jump_threshold else None,
        because("understood.least", share=100.0 * least) if least != 1.0 else None,
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


def _said(part: Reason | None) -> str:
    return "" if part is None else sentence(part)


def _number(value: float) -> str:
    return f"{value:.7g}" if abs(value) >= 5e-8 else "0"


def _numbers(values: Sequence[float], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def _direction(values: Iterable[float]) -> str:
    return f"({', '.join(_number(value) for value in values)})"


def _assignment(arm: ArmDescription, name: str, value: float) -> str:
    shown, factor = SHOWN[arm.joint(name).unit]
    return f"{name}={value * factor:.6g}{shown}"
