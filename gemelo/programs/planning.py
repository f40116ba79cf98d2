"""One leg as a plan, from given joint values; what its goal is, is decided here alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

from gemelo.api.arm import Arm
from gemelo.api.errors import BadArgument
from gemelo.api.planning import Plan
from gemelo.api.targets import FULL, Target, Waypoint
from gemelo.api.units import Pose
from gemelo.libraries.arm.errors import nearest
from gemelo.programs.points import Point
from gemelo.programs.sequence import Leg
from gemelo.programs.steps import Arc, Line, MotionStep, goal_of
from gemelo.schemas.reasons import because

ALLOWED_TIME = 5.0  # [s] for one plan


def plan_leg(arm: Arm, leg: Leg, points: Mapping[str, Point], start: Mapping[str, float] | None = None) -> Plan:
    """A verified trajectory for the leg, from `start` [rad] or [m], or from where the arm is.

    Raises `Refused`, `Lost`, or `BadArgument` for a point that is not known any more.
    """
    return arm.plan(**target_of(arm, leg, points, start))


def target_of(arm: Arm, leg: Leg, points: Mapping[str, Point], start: Mapping[str, float] | None) -> Target:
    """The arguments of `arm.plan`, from the joints `start` [rad] or [m]."""
    *before, last = [cast(MotionStep, step) for step in leg.steps]
    target = _goal(arm, last, points, start)
    if before:
        target["via"] = tuple(waypoint_of(step, points) for step in before)
        target["blend"] = min(step.blend for step in before)
    if isinstance(last, Line):
        target["line"] = True
    if isinstance(last, Arc):
        target.update(_arc(last))
    if isinstance(last, Line | Arc) and last.tool_speed > 0.0:
        target["tool_speed"] = last.tool_speed
    target["speed"], target["allowed_time"] = leg.speed, ALLOWED_TIME
    if start is not None:
        target["from_joints"] = start
    return target


def waypoint_of(step: MotionStep, points: Mapping[str, Point]) -> Waypoint:
    """A goal that is passed without a stop."""
    if step.point:
        return require_point(points, step.point).joints
    if step.state:
        return step.state
    if step.joints:
        return step.joints
    assert step.position is not None
    if step.orientation is not None:
        return Pose(step.position, step.orientation)
    if step.rpy is not None:
        return Pose.from_rpy(step.position, *step.rpy)
    return step.position


def require_point(points: Mapping[str, Point], name: str) -> Point:
    """The point; raises `BadArgument`."""
    if name not in points:
        raise BadArgument(because("point.gone", nearest(name, points), point=name))
    return points[name]


def _goal(arm: Arm, step: MotionStep, points: Mapping[str, Point], start: Mapping[str, float] | None) -> Target:
    match goal_of(step):
        case "point":
            joints = require_point(points, step.point).joints
            return _pose_target(arm, joints) if isinstance(step, Arc) else Target(joints=joints)
        case "state":
            return Target(named=step.state)
        case "joints":
            return Target(joints=step.joints)
        case "offset":
            return _offset(arm, step, start)
    target = Target(position=step.position or ())
    if step.orientation is not None:
        target["orientation"] = step.orientation
    if step.rpy is not None:
        target["rpy"] = step.rpy
    if step.along is not None:
        target["along"] = step.along
    return target


def _offset(arm: Arm, step: MotionStep, start: Mapping[str, float] | None) -> Target:
    """From where the tool is at `start`; it stays turned as it is."""
    assert step.offset is not None
    frames = (arm.tool_frame, step.frame or arm.base_frame)
    poses = arm.link_poses(start, frames)
    moved = poses[frames[1]].axis(step.offset) if step.frame else step.offset
    return _kept_turned(arm, poses[frames[0]].offset(*moved))


def _pose_target(arm: Arm, joints: Mapping[str, float]) -> Target:
    """The tool's pose at a point, for an arc, which has no goal in joint values."""
    return _kept_turned(arm, arm.fk(joints))


def _kept_turned(arm: Arm, pose: Pose) -> Target:
    """An arm of less than six joints keeps the direction of its tool's z axis alone."""
    if len(arm.joint_names) >= FULL:
        return Target(pose=pose)
    return Target(position=pose.position, along=pose.axis())


def _arc(step: Arc) -> Target:
    return Target(through=step.through) if step.through is not None else Target(center=step.center or ())
