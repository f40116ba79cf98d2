"""The first half of validation: is it a trajectory for this arm at all? Brings it into the arm's joint order."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import NamedTuple

from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import (
    MOST_POINTS,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Pieces
from gemelo.services.stepper_gateway.goals.rejections import invalid, invalid_joints

REST = 1e-6  # [rad/s] or [m/s] that a final velocity may be off zero; chosen: far below a step a second
MAX_DURATION = 3600.0  # [s] chosen: an hour; longer work is several goals


def ordered_trajectory(trajectory: JointTrajectory, joints: tuple[Joint, ...]) -> Pieces[JointTrajectory]:
    """The trajectory with its columns in the arm's order; raises `GoalRejected`."""
    require_names(trajectory.joint_names, joints)
    yield from _require_points(trajectory)
    names = tuple(joint.name for joint in joints)
    if trajectory.joint_names != names:
        order = [trajectory.joint_names.index(name) for name in names]
        points = []
        for begin in range(0, len(trajectory.points), PIECE):
            points += [_reordered(point, order) for point in trajectory.points[begin : begin + PIECE]]
            yield
        trajectory = JointTrajectory(stamp=trajectory.stamp, joint_names=names, points=tuple(points))
    _require_rest_at_end(trajectory.points[-1], joints)
    return trajectory


def require_names(names: tuple[str, ...], joints: tuple[Joint, ...]) -> None:
    """Every joint of the arm exactly once."""
    require_known(names, joints)
    known = [joint.name for joint in joints]
    missing = [name for name in known if name not in names]
    if missing:
        raise invalid_joints(f"joint {_quoted(missing)} is missing; a trajectory moves all of {', '.join(known)}")


def require_known(names: tuple[str, ...], joints: tuple[Joint, ...]) -> None:
    """Only joints of the arm, each at most once."""
    known = [joint.name for joint in joints]
    for name, count in Counter(names).items():
        if name not in known:
            raise invalid_joints(f'joint "{name}" is unknown{suggestion(name, known)}')
        if count > 1:
            raise invalid_joints(f'joint "{name}" is named {count} times; name each joint once')


Bounds = tuple[float | None, ...]  # one for each joint of the arm; None: no bound


class Tolerances(NamedTuple):
    """How far every joint may be off: [steps] and [steps/s]."""

    position: Bounds
    velocity: Bounds


def tolerances(
    goal: FollowJointTrajectoryGoal, joints: tuple[Joint, ...], factor: float
) -> tuple[Tolerances, Tolerances]:
    """Path and goal tolerance, in [rad] or [m] and per s; raises `GoalRejected`.

    As ros2_control's joint_trajectory_controller: 0 is the default, -1 none, another negative value is refused. The
    defaults are robot.toml's times `factor` for positions, and none for velocities.
    """
    path = _tolerances("path_tolerance", goal.path_tolerance, joints)
    end = _tolerances("goal_tolerance", goal.goal_tolerance, joints)
    path_defaults = [joint.drive.path_tolerance_steps * factor for joint in joints]
    end_defaults = [joint.drive.goal_tolerance_steps * factor for joint in joints]
    return _filled(path, path_defaults), _filled(end, end_defaults)


def time_tolerance(goal: FollowJointTrajectoryGoal, default: float) -> float | None:
    """[s] that the goal may end late, `default` where it says 0, None for no bound; raises `GoalRejected`."""
    asked = goal.goal_time_tolerance
    if asked == -1.0:
        return None
    if asked < 0.0:
        raise invalid(f"goal_time_tolerance is {asked:g} s; give a time, 0 for the default or -1 for no bound")
    return asked or default


def _tolerances(field: str, given: tuple[JointTolerance, ...], joints: tuple[Joint, ...]) -> Tolerances:
    """In steps: a position of 0 is the default."""
    positions: list[float | None] = [0.0] * len(joints)
    velocities: list[float | None] = [None] * len(joints)
    names = [joint.name for joint in joints]
    for tolerance in given:
        if tolerance.name not in names:
            hint = suggestion(tolerance.name, names)
            raise invalid_joints(f'{field} is for joint "{tolerance.name}", which is unknown{hint}')
        index = names.index(tolerance.name)
        joint, where = joints[index], f'{field} of joint "{tolerance.name}"'
        positions[index] = _bound(where, "position", tolerance.position, joint)
        velocities[index] = _bound(where, "velocity", tolerance.velocity, joint) or None
        if _bound(where, "acceleration", tolerance.acceleration, joint):
            raise invalid(
                f"{where}: an acceleration of {tolerance.acceleration:g} {joint.unit}/s^2 cannot be watched, because "
                "the device measures steps and velocities only; give 0 or -1, and bound the velocity"
            )
    return Tolerances(tuple(positions), tuple(velocities))


def _bound(where: str, quantity: str, value: float, joint: Joint) -> float | None:
    """In steps; None for no bound."""
    if value < 0.0 and value != -1.0:
        raise invalid(f"{where}: {quantity} {value:g} is negative; give a bound, 0 for the default or -1 for no bound")
    return None if value == -1.0 else value * joint.steps.per_unit


def _filled(given: Tolerances, defaults: list[float]) -> Tolerances:
    rows = zip(given.position, defaults, strict=True)
    return given._replace(position=tuple(default if bound == 0.0 else bound for bound, default in rows))


def _require_points(trajectory: JointTrajectory) -> Pieces[None]:
    points, width = trajectory.points, len(trajectory.joint_names)
    if not points:
        raise invalid("the trajectory has no points")
    if len(points) > MOST_POINTS:
        raise invalid(f"the trajectory has {len(points)} points, more than {MOST_POINTS}; send it in parts")
    fields = (bool(points[0].velocities), bool(points[0].accelerations))
    for index, point in enumerate(points):
        _require_size(index, "positions", point.positions, width, True)
        _require_size(index, "velocities", point.velocities, width, fields[0])
        _require_size(index, "accelerations", point.accelerations, width, fields[1])
        if index % PIECE == PIECE - 1:
            yield
    if fields == (False, True):
        raise invalid("the points have accelerations but no velocities; give both, or positions only")
    yield from _require_times([point.time_from_start for point in points])


def _require_size(index: int, field: str, values: Vector, width: int, wanted: bool) -> None:
    if len(values) != (width if wanted else 0):
        expected = f"{width} are needed, one per joint" if wanted else "point 0 has none, so no point may"
        raise invalid(f"point {index} has {len(values)} {field}; {expected}")


def _require_times(times: list[float]) -> Pieces[None]:
    if times[0] < 0.0:
        raise invalid(f"point 0 has time_from_start {times[0]:g} s; it must not be negative")
    for index, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            raise invalid(
                f"time_from_start does not increase: {before:g} s at point {index - 1}, {after:g} s at point {index}"
            )
        if index % PIECE == 0:
            yield
    if times[-1] > MAX_DURATION:
        raise invalid(f"the trajectory takes {times[-1]:g} s, more than {MAX_DURATION:g} s; send it in parts")


def _reordered(point: TrajectoryPoint, order: list[int]) -> TrajectoryPoint:
    return TrajectoryPoint(
        positions=tuple(point.positions[i] for i in order),
        velocities=tuple(point.velocities[i] for i in order) if point.velocities else (),
        accelerations=tuple(point.accelerations[i] for i in order) if point.accelerations else (),
        time_from_start=point.time_from_start,
    )


def _require_rest_at_end(last: TrajectoryPoint, joints: tuple[Joint, ...]) -> None:
    for joint, velocity in zip(joints, last.velocities, strict=bool(last.velocities)):
        if abs(velocity) > REST:
            raise invalid(
                f'joint "{joint.name}" has {velocity:g} {joint.unit}/s at the last point; a trajectory must end at '
                "rest, with velocity 0"
            )


def _quoted(names: list[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)
