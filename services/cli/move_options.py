"""The words of `gemelo move`: where to, on which way, how fast; and from them the request to the planner."""

from __future__ import annotations

from typing import TYPE_CHECKING

from services.cli.exits import usage
from services.cli.parser import Options, Parser, finite_number, length, turn

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as Group

    from schemas.planning import Goal, Motion, PlanRequest, PoseGoal
    from services.arm.description import Arm

XYZ = ("X", "Y", "Z")
EXAMPLES = """examples:
  gemelo move --to 0.25 0.15 0.10
  gemelo move --joints brazo_joint=30deg antebrazo_joint=-45deg efector_joint=40mm
  gemelo move --named ready --speed 0.5
  gemelo move --to 0.18 0.05 0.17 --rpy 180 0 0 --line --tool-speed 50
  gemelo move --to 0.18 -0.05 0.17 --arc 0.20 0 0.17
  gemelo move --via 0.25 0.05 0.15 --via 0.25 0.10 0.15 --to 0.25 0.15 0.10 --line --blend 10
  gemelo move --named left --planner RRTstar --time 3"""
TURNS = ("quaternion", "rpy", "axis", "along", "free_axis")


def move_options(parser: Parser) -> None:
    """All of them."""
    parser.epilog = EXAMPLES
    _goal_options(parser.add_argument_group("where to"))
    _way_options(parser.add_argument_group("on which way (any that is free, if nothing is said)"))
    parser.add_argument("--speed", type=finite_number, default=1.0, help="share of the velocity limits, in (0, 1]")
    parser.add_argument("--time", type=finite_number, default=1.0, metavar="S", help="that planning may take")
    parser.add_argument("--plan-only", action="store_true", help="plan, and do not move")
    parser.add_argument("--json", action="store_true", help="one JSON object instead of a line")


def _goal_options(group: Group) -> None:
    goal = group.add_mutually_exclusive_group(required=True)
    goal.add_argument("--to", nargs=3, type=length, metavar=XYZ, help="the tool in the base frame, as 300mm or 0.3")
    goal.add_argument(
        "--joints", nargs="+", metavar="JOINT=VALUE", help="30deg, 0.5rad, 40mm, 0.04m; a bare number is rad or m"
    )
    goal.add_argument("--named", metavar="STATE", help="a named state of the SRDF")
    turned = group.add_mutually_exclusive_group()
    turned.add_argument(
        "--quaternion", "--quat", nargs=4, type=finite_number, metavar=(*XYZ, "W"), help="orientation of the tool"
    )
    turned.add_argument("--rpy", nargs=3, type=turn, metavar=("R", "P", "Y"), help="the same, as 90deg, 1.57rad or 90")
    turned.add_argument("--axis", nargs=3, type=finite_number, metavar=XYZ, help="of the tool, to point --along")
    group.add_argument("--along", nargs=3, type=finite_number, metavar=XYZ, help="where --axis is to point; it is z")
    group.add_argument(
        "--free-axis", nargs=3, type=finite_number, metavar=XYZ, help="of the tool: turning about it does not matter"
    )
    group.add_argument("--frame", default="", metavar="LINK", help="in which positions are; the base, if none")


def _way_options(group: Group) -> None:
    way = group.add_mutually_exclusive_group()
    way.add_argument("--line", action="store_true", help="the tool on a straight line")
    way.add_argument("--arc", nargs=3, type=length, metavar=XYZ, help="the tool on an arc through this point")
    way.add_argument("--center", nargs=3, type=length, metavar=XYZ, help="on the shorter arc about this point")
    way.add_argument("--ptp", action="store_true", help="the joints on a straight line")
    group.add_argument(
        "--via",
        nargs=3,
        type=length,
        metavar=XYZ,
        action="append",
        default=[],
        help="a point before; repeatable",
    )
    group.add_argument("--blend", type=finite_number, metavar="MM", help="around --via within which corners are cut")
    group.add_argument("--tool-speed", type=finite_number, metavar="MM/S", help="at most, on a line or an arc")
    group.add_argument("--tool-acceleration", type=finite_number, metavar="MM/S2", help="at most, on a line or an arc")
    group.add_argument("--fraction", type=finite_number, metavar="F", help="of a line or an arc that will do")
    group.add_argument("--max-step", type=finite_number, metavar="MM", help="between two looks, on a line or an arc")
    group.add_argument(
        "--jump", type=finite_number, metavar="RAD", help="that a joint may move between them [rad] or [m]"
    )
    group.add_argument("--time-optimal", action="store_true", help="as fast as can be, without a limit of the jerk")
    group.add_argument("--planner", metavar="ID", help="native, RRTConnect, RRTstar, BITstar or PRM")
    group.add_argument("--seed", type=int, help="the same seed, the same plan")


def request_from(options: Options, arm: Arm) -> PlanRequest:
    """The request; what does not go together is refused by name."""
    from msgspec.structs import replace

    from schemas.planning import Timing
    from services.cli.goals import goal_of, request_of

    goal = goal_of(arm, options.to, options.joints or (), options.named)
    request = request_of(_by_way_of(_turned(goal, options), options), options.speed)
    if not 0.0 < options.time <= 3600.0:
        raise usage(f"--time {options.time:g} is not in (0, 3600]")
    timing = Timing.TIME_OPTIMAL if options.time_optimal else Timing.JERK_LIMITED
    return replace(request, motion=motion_of(options), allowed_time=options.time, timing=timing)


def motion_of(options: Options) -> Motion:
    """The motion that the options name."""
    from msgspec.structs import asdict

    from schemas.planning import CircularMotion, FreeMotion, LinearMotion, PointToPoint

    is_arc = options.arc is not None or options.center is not None
    is_tool = options.line or is_arc
    tool_options = ("tool_speed", "tool_acceleration", "fraction", "max_step", "jump")
    _require(is_tool, options, tool_options, "--line, --arc or --center")
    _require(not is_tool and not options.ptp, options, ("planner", "seed"), "a free motion")
    if is_tool:
        line = LinearMotion(
            speed=_metres(options, "tool_speed"),
            acceleration=_metres(options, "tool_acceleration"),
            max_step=_metres(options, "max_step"),
            jump_threshold=options.jump or 0.0,
            least_fraction=1.0 if options.fraction is None else options.fraction,
        )
        if options.line:
            return line
        return CircularMotion(interim=tuple(options.arc or ()), center=tuple(options.center or ()), **asdict(line))
    if options.ptp:
        return PointToPoint()
    return FreeMotion(planner_id=options.planner or "", seed=options.seed or 0)


def _turned(goal: Goal, options: Options) -> Goal:
    """With the orientation, where one is given."""
    from msgspec.structs import replace

    from schemas.planning import PoseGoal
    from services.arm.transforms import from_rpy

    _require(isinstance(goal, PoseGoal), options, TURNS, "--to")
    if not isinstance(goal, PoseGoal):
        return goal
    orientation = tuple(options.quaternion or ())
    if options.rpy is not None:
        orientation = from_rpy(*options.rpy)
    axis = tuple(options.axis or ((0.0, 0.0, 1.0) if options.along else ()))
    return replace(
        goal,
        orientation=orientation,
        frame=options.frame,
        free_axis=tuple(options.free_axis or ()),
        tool_axis=axis,
        direction=tuple(options.along or ()),
    )


def _by_way_of(goal: Goal, options: Options) -> Goal:
    """By the points of --via, turned as the goal is."""
    from msgspec.structs import replace

    from schemas.planning import PoseGoal, WaypointGoal

    _require(bool(options.via), options, ("blend",), "--via")
    if not options.via:
        return goal
    if options.arc is not None or options.center is not None:
        raise usage("--via does not go with --arc or --center: an arc has one goal")
    assert not isinstance(goal, WaypointGoal)
    like: PoseGoal = goal if isinstance(goal, PoseGoal) else PoseGoal()
    points = tuple(replace(like, position=tuple(point)) for point in options.via)
    return WaypointGoal(points=(*points, goal), blend=_metres(options, "blend"))


def _metres(options: Options, name: str) -> float:
    """From [mm]; 0 where it is not given, and refused where it is not above 0."""
    value: float | None = getattr(options, name)
    if value is None:
        return 0.0
    if value <= 0.0:
        raise usage(f"--{name.replace('_', '-')} {value:g} is not above 0")
    return value / 1000.0


def _require(holds: bool, options: Options, names: tuple[str, ...], needed: str) -> None:
    for name in names:
        if not holds and getattr(options, name) is not None:
            raise usage(f"--{name.replace('_', '-')} goes with {needed} only")
