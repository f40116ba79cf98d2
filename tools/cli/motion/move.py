"""`gemelo move`: plans a motion, executes it, and prints how exactly the arm arrived."""

from __future__ import annotations

from typing import TYPE_CHECKING

from msgspec.structs import replace

import gemelo
from gemelo.api.targets import usual_time
from gemelo.schemas.planners import NAMES
from gemelo.schemas.planning import PlanProgress, PlanRequest
from gemelo.schemas.reasons import because
from gemelo.tools.cli.bus.request_text import refusal_error, request_text, understood
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.terminal import CANCELLING, LiveBlock, motion_progress
from gemelo.tools.cli.common.units import acceleration, angle, length, rotation, seconds, share, speed
from gemelo.tools.cli.motion.move_report import MoveReport, PlanReport, report_of, summary
from gemelo.tools.cli.motion.move_request import request_from, require_alone
from gemelo.tools.cli.parser import Choices, Options, Parser, finite_number

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as Group

    from gemelo import Arm, Motion, Plan, Robot
    from gemelo.libraries.arm.model.description import ArmDescription

XYZ = ("X", "Y", "Z")
EXAMPLES = """examples:
  gemelo move --to 0.25 0.15 0.10
  gemelo move --joints brazo_joint=30deg antebrazo_joint=-45deg efector_joint=40mm
  gemelo move --named ready --speed 50%
  gemelo move --to 0.18 0.05 0.17 --rpy 180deg 0 0 --line --tool-speed 50mm/s
  gemelo move --to 0.18 -0.05 0.17 --arc 0.20 0 0.17
  gemelo move --via 0.25 0.05 0.15 --via 0.25 0.10 0.15 --to 0.25 0.15 0.10 --line --blend 10mm
  gemelo move --named left --planner RRTstar --time 3
  gemelo move --named left --plan-only --json > plan.json
  gemelo move --execute plan.json

A length without a unit is in m, a speed in m/s; an angle needs deg or rad, a share %."""


def add_options(parser: Parser) -> None:
    """Adds goal, motion, speed and output options."""
    parser.epilog = EXAMPLES
    _goal_options(parser.add_argument_group("where to"))
    _motion_options(parser.add_argument_group("on which path (any that is free, if nothing is said)"))
    parser.add_argument("--speed", type=share, metavar="SHARE", help="of the velocity limits, as 50%%")
    parser.add_argument(
        "--time",
        type=seconds,
        metavar="TIME",
        help=f"that planning may take, as 3 or 3s; {usual_time(0):g} s, if nothing is said",
    )
    parser.add_argument(
        "--clearance", type=length, metavar="DISTANCE", help="that stays free, from 0.5mm to 50mm; else the robot's own"
    )
    parser.add_argument("--plan-only", action="store_true", help="plan, and do not move")
    parser.add_argument("--json", action="store_true", help="one JSON object in SI units instead of a line")


def _goal_options(group: Group) -> None:
    goal = group.add_mutually_exclusive_group(required=True)
    goal.add_argument("--to", nargs=3, type=length, metavar=XYZ, help="the tool in the base frame, as 300mm or 0.3")
    goal.add_argument("--joints", nargs="+", metavar="JOINT=VALUE", help="30deg or 0.5rad; 40mm or 0.04")
    goal.add_argument("--named", metavar="STATE", help="a named state of the SRDF")
    goal.add_argument(
        "--execute", metavar="FILE", help="the plan that --plan-only --json has written; - is standard input"
    )
    turned = group.add_mutually_exclusive_group()
    turned.add_argument(
        "--quaternion", "--quat", nargs=4, type=finite_number, metavar=(*XYZ, "W"), help="orientation of the tool"
    )
    turned.add_argument("--rpy", nargs=3, type=rotation, metavar=("R", "P", "Y"), help="the same, as 90deg or 1.57rad")
    turned.add_argument("--axis", nargs=3, type=finite_number, metavar=XYZ, help="of the tool, to point --along")
    group.add_argument("--along", nargs=3, type=finite_number, metavar=XYZ, help="where --axis is to point; it is z")
    group.add_argument(
        "--free-axis", nargs=3, type=finite_number, metavar=XYZ, help="of the tool: turning about it does not matter"
    )
    group.add_argument("--frame", default="", metavar="LINK", help="in which positions are; the base, if none")


def _motion_options(group: Group) -> None:
    path = group.add_mutually_exclusive_group()
    path.add_argument("--line", action="store_true", help="the tool on a straight line")
    path.add_argument("--arc", nargs=3, type=length, metavar=XYZ, help="the tool on an arc through this point")
    path.add_argument("--center", nargs=3, type=length, metavar=XYZ, help="on the shorter arc about this point")
    path.add_argument("--ptp", action="store_true", help="the joints on a straight line")
    group.add_argument(
        "--via", nargs=3, type=length, metavar=XYZ, action="append", default=[], help="a point before; repeatable"
    )
    group.add_argument(
        "--blend", type=length, metavar="DISTANCE", help="around --via within which corners are cut, as 10mm"
    )
    tool_speed, tool_acceleration = "at most, on a line or an arc, as 50mm/s or 0.05", "the same, as 200mm/s2 or 0.2"
    group.add_argument("--tool-speed", type=speed, metavar="SPEED", help=tool_speed)
    group.add_argument("--tool-acceleration", type=acceleration, metavar="ACCELERATION", help=tool_acceleration)
    group.add_argument("--fraction", type=share, metavar="SHARE", help="of a line or an arc that will do, as 80%%")
    group.add_argument(
        "--max-step", type=length, metavar="DISTANCE", help="between two checks, on a line or an arc, as 2mm"
    )
    jump = "that a joint may turn between them, as 30deg; a sliding one as many metres as radians"
    group.add_argument("--jump", type=angle, metavar="ANGLE", help=jump)
    group.add_argument("--time-optimal", action="store_true", help="as fast as can be, without a limit of the jerk")
    group.add_argument("--planner", metavar="ID", help=f"{', '.join(NAMES)} (docs/planners.md says what each can do)")
    group.add_argument("--seed", type=int, help="the same seed, the same plan")
    attempts = "as many times as usual is looked for a shorter way, up to 1000, within --time"
    group.add_argument("--attempts", type=int, metavar="N", help=attempts)


def run(options: Options) -> ExitCode:
    """Plans and, without --plan-only, executes; or executes a plan of before."""
    robot = load_robot()
    if options.execute is not None:
        from gemelo.tools.cli.motion.plan_file import read_plan  # for --execute alone

        require_alone(options)
        plan = read_plan(options.execute, robot.description)
        with connect_arm(robot) as arm:
            return execute(arm, plan, options.json)
    request = request_from(options, robot.description)
    if not options.json:
        print(understood(request_text(request, robot.description)), flush=True)
    with connect_arm(robot) as arm:
        return move(arm, request, options.plan_only, options.json)


def choices(robot: Robot | None) -> Choices:
    """The named states and joints, after their options."""
    if robot is None:
        return {}
    return {
        "--named": robot.description.state_names,
        "--joints": [f"{joint.name}=" for joint in robot.description.joints],
        "--planner": NAMES,
    }


def move(arm: Arm, request: PlanRequest, plan_only: bool, as_json: bool) -> ExitCode:
    """Plans and, unless `plan_only`, executes; prints one line or one JSON object at the end."""
    plan = make_plan(arm, request, quiet=as_json)
    if not plan_only:
        return execute(arm, plan, as_json)
    report = PlanReport(
        robot=arm.name, planned_s=plan.planning_time, duration_s=plan.duration, response=plan.response
    )  # fmt: skip
    return _print(report, plan, arm.description, as_json)


def make_plan(arm: Arm, request: PlanRequest, quiet: bool = False) -> Plan:
    """A verified trajectory; a refusal is raised with its reason and what would do, Ctrl-C as CANCELLED."""
    block = LiveBlock(False if quiet else None)

    def show(progress: PlanProgress) -> None:
        times = {"time": progress.elapsed, "allowed": progress.allowed}
        block.draw(sentence(because("move.planning", phase=str(progress.phase), **times)))

    try:
        return arm.plan(request, on_progress=show)
    except gemelo.Refused as error:
        raise refusal_error(error, request.goal, arm.description) from error
    except gemelo.Interrupted as error:
        raise CommandError(error, ExitCode.CANCELLED) from error
    finally:
        block.say()


def execute(arm: Arm, plan: Plan, as_json: bool) -> ExitCode:
    """Executes a plan and prints one line or one JSON object at the end; raises `CommandError` if it is refused."""
    return _print(follow(arm, plan, quiet=as_json), plan, arm.description, as_json)


def _print(report: MoveReport, plan: Plan, arm: ArmDescription, as_json: bool) -> ExitCode:
    if plan.response.stopped_by is not None:
        by = plan.response.stopped_by
        report = replace(report, fraction=plan.response.fraction, stopped_by=by.message, stopped_why=by.why)
    print(report.as_json() if as_json else summary(report, arm, isinstance(report, PlanReport)))
    return report.exit_code


def follow(arm: Arm, plan: Plan, quiet: bool = False) -> MoveReport:
    """Executes `plan`; Ctrl-C cancels and waits for where the arm came to rest.

    The motion is detached: it goes on when this process is killed.
    """
    with motion_progress(plan.duration, quiet) as shown:

        def on_progress(motion: Motion) -> None:
            if motion.feedback is not None:
                shown(motion.feedback.elapsed, motion.feedback.duration)

        def on_cancel(motion: Motion) -> None:
            if not quiet:
                print(sentence(CANCELLING), flush=True)

        try:
            motion = arm.execute(plan, detached=True, on_progress=on_progress, on_cancel=on_cancel)
        except gemelo.Refused as error:
            raise CommandError(error) from error
        except gemelo.Lost as error:
            if not error.has_begun:
                raise
            raise CommandError(error) from error
        except (gemelo.Aborted, gemelo.Interrupted) as error:
            return _report_of_end(arm, plan, error)
    return report_of(arm.description, plan, motion.status, motion.result, motion.stopped_at)


def _report_of_end(arm: Arm, plan: Plan, error: gemelo.Aborted | gemelo.Interrupted) -> MoveReport:
    """The report of a motion that ended before its goal; raises `CommandError` where nobody says how it ended."""
    is_interrupted = isinstance(error, gemelo.Interrupted)
    if error.result is None:
        raise CommandError(error, ExitCode.CANCELLED if is_interrupted else ExitCode.FAILED) from error
    report = report_of(arm.description, plan, error.status, error.result, error.stopped_at)
    return replace(report, interrupted=is_interrupted)
