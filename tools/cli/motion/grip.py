"""`gemelo grip`: opens and closes the gripper."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.output import control
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.units import LENGTH, parse_quantity
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.api.arguments import Grip
    from gemelo.schemas.gripper import GripperCommandFeedback, GripperState

WORDS = ("open", "close")
STATE = "state"


def add_options(parser: Parser) -> None:
    """Adds where to, the greatest force and --json."""
    parser.add_argument(
        "to", metavar="TO", nargs="?", default=STATE, help="open, close, or an opening as 25mm; without it: how it is"
    )
    parser.add_argument("--max-effort", type=float, default=0.0, metavar="N", help="refuse to press with more [N]")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Opens or closes it; an opening that it cannot have is refused before the stack is asked."""
    robot = load_robot()
    gripper = robot.description.gripper
    if gripper is None:
        raise CommandError(because("client.no_gripper", robot=robot.description.name))
    if options.to == STATE:
        with connect_arm(robot) as arm:
            return _show(arm, options.json)
    to = opening(options.to)
    if isinstance(to, float) and not gripper.closed <= to <= gripper.open:
        limits = {"least": gripper.closed, "most": gripper.open}
        raise usage(because("argument.grip.range", value=to, **limits))
    with connect_arm(robot) as arm:
        return grip(arm, to, options.max_effort, options.json)


def choices(robot: Robot | None) -> Choices:
    """Open and close."""
    return {"": WORDS}


def opening(text: str) -> Grip:
    """ "open", "close", or an opening [m]; raises `CommandError` for a number that is no length."""
    return text if text in WORDS else parse_quantity(text, LENGTH, "opening")


def grip(arm: Arm, to: Grip, max_effort: float, as_json: bool) -> ExitCode:
    """Opens or closes the gripper with at most `max_effort` [N] and prints how; raises `CommandError` if it has not."""
    is_live = sys.stderr.isatty() and not as_json

    def show(feedback: GripperCommandFeedback) -> None:
        if is_live:
            control(f"\r{feedback.position * 1000:6.1f} mm", sys.stderr)

    try:
        gripped = arm.grip(to, max_effort=max_effort, on_progress=show)
    except gemelo.Error as error:
        raise CommandError(error) from error
    finally:
        if is_live:
            control("\r", sys.stderr)
    line = sentence(because("pick.gripper", gripped.summary))
    print(msgspec.json.encode(gripped._asdict()).decode() if as_json else line)
    return ExitCode.OK


def _show(arm: Arm, as_json: bool) -> ExitCode:
    state = arm.gripper
    if as_json:
        print(msgspec.json.encode(state).decode())
    else:
        print(sentence(standing(state)))
    return ExitCode.OK


def standing(state: GripperState) -> Reason:
    """How far the gripper is open, and with what force it presses."""
    if not state.known:
        return because("gripper.unknown")
    known = because("gripper.at" if state.measured else "gripper.at.commanded", opening=1e3 * state.position)
    return because("gripper.presses", known, force=state.effort) if state.effort else known
