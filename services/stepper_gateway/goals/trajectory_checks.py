"""The first half of validation: is it a trajectory for this arm at all? Brings it into the arm's joint order."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import NamedTuple

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import (
    MOST_POINTS,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.reasons import Value, because, remedy
from gemelo.services.stepper_gateway.goals.pieces import PIECE, Pieces
from gemelo.services.stepper_gateway.goals.rejections import invalid, invalid_joints

REST = 1e-6  # [rad/s] or [m/s] that a final velocity may be off zero; chosen: far below a step a second
MAX_DURATION = 3600.0  # [s] chosen: an hour; longer work is several goals


def ordered_trajectory(
    trajectory: JointTrajectory, joints: tuple[Joint, ...], hold: Vector | None = None
) -> Pieces[JointTrajectory]:
    """The trajectory with its columns in the arm's order; joints that it does not name stay at `hold` (n,) [rad] or
    [m], where that is known. Raises `GoalRejected`."""
    require_names(trajectory.joint_names, joints, hold is not None)
    yield from _require_points(trajectory)
    names = tuple(joint.name for joint in joints)
    if trajectory.joint_names != names:
        order = [_index(trajectory.joint_names, name) for name in names]
        points = []
        for begin in range(0, len(trajectory.points), PIECE):
            points += [_reordered(point, order, hold or ()) for point in trajectory.points[begin : begin + PIECE]]
            yield
        trajectory = JointTrajectory(stamp=trajectory.stamp, joint_names=names, points=tuple(points))
    _require_rest_at_end(trajectory.points[-1], joints)
    return trajectory


def require_names(names: tuple[str, ...], joints: tuple[Joint, ...], may_hold: bool = False) -> None:
    """Every joint of the arm exactly once; some of them where the others `may_hold` their places."""
    require_known(names, joints)
    known = [joint.name for joint in joints]
    missing = [name for name in known if name not in names]
    if missing and not (names and may_hold):
        raise invalid_joints(because("goal.joints.missing", joints=tuple(missing), known=tuple(known)))


def require_known(names: tuple[str, ...], joints: tuple[Joint, ...]) -> None:
    """Only joints of the arm, each at most once."""
    known = [joint.name for joint in joints]
    for name, count in Counter(names).items():
        if name not in known:
            raise invalid_joints(because("goal.joints.unknown", nearest(name, known), joint=name))
        if count > 1:
            raise invalid_joints(because("goal.joints.repeated", joint=name, count=count))


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
        raise invalid(because("goal.tolerance.time", value=asked))
    return asked or default


def _tolerances(field: str, given: tuple[JointTolerance, ...], joints: tuple[Joint, ...]) -> Tolerances:
    """In steps: a position of 0 is the default."""
    positions: list[float | None] = [0.0] * len(joints)
    velocities: list[float | None] = [None] * len(joints)
    names = [joint.name for joint in joints]
    for tolerance in given:
        if tolerance.name not in names:
            guess = nearest(tolerance.name, names)
            raise invalid_joints(because("goal.tolerance.unknown_joint", guess, field=field, joint=tolerance.name))
        index = names.index(tolerance.name)
        joint = joints[index]
        positions[index] = _bound(field, "position", tolerance.position, joint)
        velocities[index] = _bound(field, "velocity", tolerance.velocity, joint) or None
        if _bound(field, "acceleration", tolerance.acceleration, joint):
            named = {"field": field, "joint": joint.name, "unit": joint.unit}
            raise invalid(because("goal.tolerance.acceleration", value=tolerance.acceleration, **named))
    return Tolerances(tuple(positions), tuple(velocities))


def _bound(field: str, quantity: str, value: float, joint: Joint) -> float | None:
    """In steps; None for no bound."""
    if value < 0.0 and value != -1.0:
        named = {"field": field, "joint": joint.name, "quantity": quantity}
        raise invalid(because("goal.tolerance.negative", value=value, **named))
    return None if value == -1.0 else value * joint.steps.per_unit


def _filled(given: Tolerances, defaults: list[float]) -> Tolerances:
    rows = zip(given.position, defaults, strict=True)
    return given._replace(position=tuple(default if bound == 0.0 else bound for bound, default in rows))


def _require_points(trajectory: JointTrajectory) -> Pieces[None]:
    points, width = trajectory.points, len(trajectory.joint_names)
    if not points:
        raise invalid(because("goal.points.none"))
    if len(points) > MOST_POINTS:
        parts = remedy("in_parts")
        raise invalid(because("goal.points.too_many", parts, count=len(points), limit=MOST_POINTS))
    fields = (bool(points[0].velocities), bool(points[0].accelerations))
    for index, point in enumerate(points):
        _require_size(index, "positions", point.positions, width, True)
        _require_size(index, "velocities", point.velocities, width, fields[0])
        _require_size(index, "accelerations", point.accelerations, width, fields[1])
        if index % PIECE == PIECE - 1:
            yield
    if fields == (False, True):
        raise invalid(because("goal.points.no_velocities"))
    yield from _require_times([point.time_from_start for point in points])


def _require_size(index: int, field: str, values: Vector, width: int, wanted: bool) -> None:
    if len(values) != (width if wanted else 0):
        found: dict[str, Value] = {"point": index, "count": len(values), "field": field}
        if wanted:
            raise invalid(because("goal.points.width", limit=width, **found))
        raise invalid(because("goal.points.unlike_first", **found))


def _require_times(times: list[float]) -> Pieces[None]:
    if times[0] < 0.0:
        raise invalid(because("goal.time.negative", value=times[0]))
    for index, (before, after) in enumerate(pairwise(times), start=1):
        if after <= before:
            raise invalid(
                because("goal.time.not_increasing", before=before, first=index - 1, after=after, second=index)
            )
        if index % PIECE == 0:
            yield
    if times[-1] > MAX_DURATION:
        parts = remedy("in_parts")
        raise invalid(because("goal.time.too_long", parts, time=times[-1], limit=MAX_DURATION))


def _index(names: tuple[str, ...], name: str) -> int | None:
    return names.index(name) if name in names else None


def _reordered(point: TrajectoryPoint, order: list[int | None], hold: Vector) -> TrajectoryPoint:
    """The columns in `order`; a joint of which there is none stands at its place in `hold`."""

    def row(values: Vector, others: Vector) -> Vector:
        columns = enumerate(order)
        return tuple(others[at] if index is None else values[index] for at, index in columns) if values else ()

    zeros = (0.0,) * len(order)
    return TrajectoryPoint(
        positions=row(point.positions, hold),
        velocities=row(point.velocities, zeros),
        accelerations=row(point.accelerations, zeros),
        time_from_start=point.time_from_start,
    )


def _require_rest_at_end(last: TrajectoryPoint, joints: tuple[Joint, ...]) -> None:
    for joint, velocity in zip(joints, last.velocities, strict=bool(last.velocities)):
        if abs(velocity) > REST:
            named = {"joint": joint.name, "unit": joint.unit}
            raise invalid(because("goal.points.moving_end", value=velocity, **named))
