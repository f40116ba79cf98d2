"""The options of `gemelo move` turned into the planner's request, in SI units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from msgspec.structs import asdict, replace

from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.schemas.planning import (
    MOST_ATTEMPTS,
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
    Timing,
    WaypointGoal,
)
from gemelo.schemas.robot import LEAST_CLEARANCE, MOST_CLEARANCE
from gemelo.tools.cli.common.errors import unknown, usage
from gemelo.tools.cli.common.units import parse_joints
from gemelo.tools.cli.parser import Options

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

DEFAULT_TIME = 1.0  # [s] that planning may take if nothing is said
LONGEST_TIME = 3600.0  # [s] that planning may be allowed
TOOL_Z = (0.0, 0.0, 1.0)
ORIENTATION = ("quaternion", "rpy", "axis", "along", "free_axis")
GOAL_OPTIONS = (
    "quaternion", "rpy", "axis", "along", "free_axis", "frame", "line", "arc", "center", "ptp", "via", "blend",
    "tool_speed", "tool_acceleration", "fraction", "max_step", "jump", "time_optimal", "planner", "seed", "speed",
    "time", "clearance", "plan_only",
)  # fmt: skip
TOOL_MOTION = ("tool_speed", "tool_acceleration", "fraction", "max_step", "jump")


def request_from(options: Options, arm: ArmDescription) -> PlanRequest:
    """The request in SI units; raises `CommandError` naming options that do not go together."""
    goal = goal_of(arm, options.to, options.joints or (), options.named)
    speed = 1.0 if options.speed is None else options.speed
    request = request_of(_with_waypoints(_with_orientation(goal, options), options), speed)
    time = DEFAULT_TIME if options.time is None else options.time
    if not 0.0 < time <= LONGEST_TIME:
        raise usage(f"--time {time:g} is not in (0, {LONGEST_TIME:g}] s")
    timing = Timing.TIME_OPTIMAL if options.time_optimal else Timing.JERK_LIMITED
    return replace(request, motion=motion_of(options), allowed_time=time, clearance=_clearance(options), timing=timing)


def goal_of(arm: ArmDescription, to: Sequence[float] | None, joints: Sequence[str], named: str | None) -> Goal:
    """The goal: exactly one of a tool position (3,) [m], joint assignments, and a named state."""
    given = [bool(to), bool(joints), named is not None]
    if sum(given) != 1:
        raise usage("say where to: one of --to X Y Z, --joints name=30deg ..., --named state")
    if to:
        return PoseGoal(position=tuple(to))
    if joints:
        values = parse_joints(joints, arm.joints)
        return JointGoal(name=tuple(values), position=tuple(values.values()))
    assert named is not None
    if named not in arm.state_names:
        raise unknown("named state", named, arm.state_names)
    return NamedGoal(name=named)


def request_of(goal: Goal, speed: float) -> PlanRequest:
    """A request at `speed`, the share of the velocity limits in (0, 1]."""
    if not 0.0 < speed <= 1.0:
        raise usage(f"--speed {100.0 * speed:g}% is not above 0% and at most 100%")
    return PlanRequest(goal=goal, velocity_scaling=speed)


def motion_of(options: Options) -> Motion:
    """The kind of motion that the options name; raises `CommandError` for an option of another kind."""
    is_arc = options.arc is not None or options.center is not None
    is_tool = options.line or is_arc
    _require(is_tool, options, TOOL_MOTION, "--line, --arc or --center")
    _require(not is_tool and not options.ptp, options, ("planner", "seed", "attempts"), "a free motion")
    if is_tool:
        line = LinearMotion(
            speed=_positive(options, "tool_speed"),
            acceleration=_positive(options, "tool_acceleration"),
            max_step=_positive(options, "max_step"),
            jump_threshold=_positive(options, "jump"),
            least_fraction=1.0 if options.fraction is None else _positive(options, "fraction"),
        )
        if options.line:
            return line
        return CircularMotion(interim=tuple(options.arc or ()), center=tuple(options.center or ()), **asdict(line))
    if options.ptp:
        return PointToPoint()
    attempts = 1 if options.attempts is None else options.attempts
    if not 1 <= attempts <= MOST_ATTEMPTS:
        raise usage(f"--attempts {attempts} is not from 1 to {MOST_ATTEMPTS}")
    return FreeMotion(planner_id=options.planner or "", seed=options.seed or 0, attempts=attempts)


def _clearance(options: Options) -> float | None:
    """[m], or None: the robot's own. Raises `CommandError` for what no plan may keep."""
    value: float | None = options.clearance
    if value is not None and not LEAST_CLEARANCE <= value <= MOST_CLEARANCE:
        least, most = 1000.0 * LEAST_CLEARANCE, 1000.0 * MOST_CLEARANCE
        raise usage(f"--clearance {1000.0 * value:g}mm is not from {least:g}mm to {most:g}mm")
    return value


def _with_orientation(goal: Goal, options: Options) -> Goal:
    _require(isinstance(goal, PoseGoal), options, ORIENTATION, "--to")
    return oriented(goal, options) if isinstance(goal, PoseGoal) else goal


def oriented(goal: PoseGoal, options: Options) -> PoseGoal:
    """`goal` with the frame and the orientation that the options give; --along alone points the tool's z."""
    orientation = from_rpy(*options.rpy) if options.rpy is not None else tuple(options.quaternion or ())
    return replace(
        goal,
        orientation=orientation,
        frame=options.frame,
        free_axis=tuple(options.free_axis or ()),
        tool_axis=tuple(options.axis or (TOOL_Z if options.along else ())),
        direction=tuple(options.along or ()),
    )


def _with_waypoints(goal: Goal, options: Options) -> Goal:
    """The goal after the points of --via, which get its orientation."""
    _require(bool(options.via), options, ("blend",), "--via")
    if not options.via:
        return goal
    if options.arc is not None or options.center is not None:
        raise usage("--via does not go with --arc or --center: an arc has one goal")
    assert not isinstance(goal, WaypointGoal)
    like: PoseGoal = goal if isinstance(goal, PoseGoal) else PoseGoal()
    points = tuple(replace(like, position=tuple(point)) for point in options.via)
    return WaypointGoal(points=(*points, goal), blend=_positive(options, "blend"))


def _positive(options: Options, name: str) -> float:
    """The option's value; 0 if it is not given. Raises `CommandError` if it is not above 0."""
    value: float | None = getattr(options, name)
    if value is None:
        return 0.0
    if value <= 0.0:
        raise usage(f"--{name.replace('_', '-')} {value:g} is not above 0")
    return value


def require_alone(options: Options) -> None:
    """Raises `CommandError` for an option that goes with a goal only: a plan of before has its own path and speed."""
    values = {name: getattr(options, name) for name in GOAL_OPTIONS}
    given = [name for name, value in values.items() if value or (value == 0 and value is not False)]
    if given:
        raise usage(f"--{given[0].replace('_', '-')} does not go with --execute: the plan has its own path and speed")


def _require(holds: bool, options: Options, names: tuple[str, ...], needed: str) -> None:
    for name in names:
        if not holds and getattr(options, name) is not None:
            raise usage(f"--{name.replace('_', '-')} goes with {needed} only")
