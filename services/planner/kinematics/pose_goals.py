"""The tool's target in the base frame of a pose goal in any of its forms; contradictions are refused."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, Point, Quaternion, Rigid, compose, inverse, rotate
from gemelo.libraries.arm.kinematics.kinematics import FramePose
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import PlanCode, PoseGoal
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.kinematics.targets import AxisPointing, ToolTarget, turn_between
from gemelo.services.planner.request.refusals import malformed

Array = NDArray[np.float64]

INVALID = PlanCode.INVALID_GOAL_CONSTRAINTS
# Tuning constants: chosen, where a line does not say measured or standard.
UNIT = 1e-3  # that a quaternion's length may be off by
LEAST_AXIS = 1e-9  # length below which an axis has no direction; chosen: its square is far from underflow
FARTHEST = 1e6  # [m] beyond which a position is a mistake, and squares lose their digits


def target_of(goal: PoseGoal, frame: Rigid) -> ToolTarget:
    """The target of `goal`, given in `frame` (its pose in the base); raises `PlanRefused`."""
    _require_form(goal)
    x, y, z = goal.position
    position = np.array(compose(frame, ((x, y, z), IDENTITY[1]))[0])
    tolerances = (goal.position_tolerance, goal.orientation_tolerance)
    if goal.tool_axis:
        axis, direction = _unit(goal.tool_axis), rotate(frame[1], _unit(goal.direction))
        return ToolTarget(position, None, AxisPointing(np.array(axis), np.array(direction)), *tolerances)
    if not goal.orientation:
        return ToolTarget(position, None, None, *tolerances)
    rotation = _matrix(compose(frame, (IDENTITY[0], _quaternion(goal.orientation)))[1])
    if goal.free_axis:
        axis_ = np.array(_unit(goal.free_axis))
        return ToolTarget(position, None, AxisPointing(axis_, rotation @ axis_), *tolerances)
    return ToolTarget(position, rotation, None, *tolerances)


def as_goal(goal: PoseGoal, pose: FramePose, frame: Rigid) -> Vector:
    """`pose` (in the base) in the form of `goal` and in `frame`: position (3,) [m], then the quaternion x y z w, the
    unit direction (3,), or nothing."""
    back = inverse(frame)
    x, y, z = pose.position.tolist()
    point = compose(back, ((x, y, z), IDENTITY[1]))[0]
    if goal.tool_axis:
        a, b, c = (pose.rotation @ np.array(_unit(goal.tool_axis))).tolist()
        return (*point, *rotate(back[1], (a, b, c)))
    if not goal.orientation:
        return point
    rotation = pose.rotation
    if goal.free_axis:
        rotation = _least_turned(_matrix(compose(frame, (IDENTITY[0], _quaternion(goal.orientation)))[1]), goal, pose)
    turn = pin.Quaternion(rotation)
    return (*point, *compose(back, (IDENTITY[0], (turn.x, turn.y, turn.z, turn.w)))[1])


def _least_turned(asked: Array, goal: PoseGoal, pose: FramePose) -> Array:
    """Of the rotations that have the free axis where `pose` has it, the one nearest to what was asked."""
    axis = np.array(_unit(goal.free_axis))
    turned: Array = pin.exp3(turn_between(asked @ axis, pose.rotation @ axis)) @ asked
    return turned


def _require_form(goal: PoseGoal) -> None:
    """Raises `PlanRefused` for what is no pose, or two at once."""
    if len(goal.position) != 3:
        why = because("plan.numbers", remedy("point_in_metres"), name="position", needed=3, count=len(goal.position))
        raise malformed(INVALID, "position", why)
    if max(abs(value) for value in goal.position) > FARTHEST:
        why = because("plan.pose.far", remedy("point_in_metres"), position=goal.position, most=FARTHEST)
        raise malformed(INVALID, "position", why)
    if goal.orientation:
        _require_quaternion(goal.orientation)
    for name in ("free_axis", "tool_axis", "direction"):
        _require_axis(name, getattr(goal, name))
    for name in ("position_tolerance", "orientation_tolerance"):
        _require_tolerance(name, getattr(goal, name))
    _require_one_meaning(goal)


def _require_one_meaning(goal: PoseGoal) -> None:
    if goal.orientation and (goal.tool_axis or goal.direction):
        why = because("plan.pose.two_meanings", remedy("one_meaning"))
        raise malformed(INVALID, "orientation", why)
    if bool(goal.tool_axis) != bool(goal.direction):
        given, missing = ("tool_axis", "direction") if goal.tool_axis else ("direction", "tool_axis")
        would_do = remedy("axis_and_direction"), remedy("leave_empty", name=given)
        named = {"given": given, "missing": missing}
        why = because("plan.pose.half", *would_do, **named, axis=getattr(goal, given))
        raise malformed(INVALID, missing, why)
    if goal.free_axis and not goal.orientation:
        would_do = remedy("give_orientation"), remedy("axis_and_direction")
        why = because("plan.pose.free_axis", *would_do, axis=goal.free_axis)
        raise malformed(INVALID, "free_axis", why)


def _require_quaternion(values: Vector) -> None:
    if len(values) != 4:
        why = because("plan.numbers", remedy("unit_quaternion"), name="orientation", needed=4, count=len(values))
        raise malformed(INVALID, "orientation", why)
    length = math.hypot(*values)
    if abs(length - 1.0) > UNIT:
        would_do = remedy("unit_quaternion")
        if LEAST_AXIS < length < 1.0 / LEAST_AXIS:
            would_do = remedy("this_quaternion", values=tuple(value / length for value in values))
        why = because("plan.pose.quaternion", would_do, orientation=values, length=length)
        raise malformed(INVALID, "orientation", why)


def _require_axis(name: str, values: Vector) -> None:
    """Any length but zero will do: only the direction counts."""
    if not values:
        return
    if len(values) != 3:
        why = because("plan.numbers", remedy("give_axis"), name=name, needed=3, count=len(values))
        raise malformed(INVALID, name, why)
    length = math.hypot(*values)
    if not LEAST_AXIS < length < 1.0 / LEAST_AXIS:
        why = because("plan.pose.axis", remedy("give_axis"), name=name, axis=values, length=length)
        raise malformed(INVALID, name, why)


def _require_tolerance(name: str, value: float) -> None:
    if value < 0.0:
        unit = "m" if name == "position_tolerance" else "rad"
        would_do = remedy("exact"), remedy("larger_tolerance")
        why = because("plan.pose.tolerance", *would_do, name=name, value=value, unit=unit)
        raise malformed(INVALID, name, why)


def _unit(values: Vector) -> Point:
    length = math.hypot(*values)
    x, y, z = values
    return x / length, y / length, z / length


def _quaternion(values: Vector) -> Quaternion:
    length = math.hypot(*values)
    x, y, z, w = values
    return x / length, y / length, z / length, w / length


def _matrix(quaternion: Quaternion) -> Array:
    matrix: Array = pin.Quaternion(np.array(quaternion)).normalized().matrix()
    return matrix
