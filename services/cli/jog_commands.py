"""The command that moves the arm by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from services.cli.exits import ExitCode, usage
from services.cli.parser import Command, Options, Parser, Words, finite_number, positive_number

if TYPE_CHECKING:
    from schemas.planning import JogCommand
    from services.arm.description import Arm

HELP = """Hold a key to move; letting go stops the arm.
  tool    w/s +x -x      a/d +y -y      q/e +z -z      t axes of the base, or of the tool
  turn    i/k about x    j/l about y    u/o about z
  joint   1-9 choose     arrows move it
  +/- faster, slower     space stop     x, Esc or Ctrl-C leave"""
EXAMPLES = f"""{HELP}

It slows down before joint limits, singularities and obstacles, and says which.

examples:
  gemelo jog                                              # with the keys
  gemelo jog --joint brazo_joint=10deg/s --for 0.5
  gemelo jog --twist 0.05 0 0 --frame tool --for 1        # 50 mm/s along the tool's x"""


def jog_options(parser: Parser) -> None:
    parser.epilog = EXAMPLES
    parser.add_argument(
        "--joint", nargs="+", default=[], metavar="JOINT=SPEED", help="10deg/s, 0.2rad/s, 5mm/s; several move together"
    )
    parser.add_argument(
        "--twist", nargs=3, type=finite_number, default=[], metavar=("VX", "VY", "VZ"), help="speed of the tool [m/s]"
    )
    parser.add_argument(
        "--turn",
        nargs=3,
        type=finite_number,
        default=[],
        metavar=("WX", "WY", "WZ"),
        help="at which the tool turns [deg/s]",
    )
    parser.add_argument(
        "--frame",
        choices=("base", "tool"),
        default="base",
        help="whose axes --twist and --turn are along; the base's, if not said",
    )
    parser.add_argument(
        "--for",
        dest="seconds",
        type=positive_number,
        metavar="SECONDS",
        help="how long it moves with --joint, --twist or --turn",
    )


def jog(options: Options) -> ExitCode:
    by_hand = not (options.joint or options.twist or options.turn)
    if by_hand and options.seconds is None:
        return _by_hand()
    if by_hand or options.seconds is None:
        raise usage("give --joint or --twist and --for so many seconds, or none of them to move with the keys")
    from services.cli.jog import jog_for
    from services.cli.session import connect, load

    command = command_of(load()[1], options.joint, options.twist, options.turn, options.frame == "tool")
    with connect() as session:
        return jog_for(session, command, options.seconds)


def _by_hand() -> ExitCode:
    """Refuses at once where there is no terminal."""
    from services.cli.keyboard import require_terminal
    from services.cli.session import connect

    require_terminal("give --joint or --twist, and --for so many seconds")
    with connect() as session:
        from services.cli.jog import jog_by_hand

        return jog_by_hand(session)


def command_of(
    arm: Arm, joints: Sequence[str], twist: Sequence[float], turn: Sequence[float], in_tool: bool
) -> JogCommand:
    """What a person has written, in SI."""
    from schemas.planning import JogCommand
    from services.cli.units import parse_joints

    if joints and (twist or turn):
        raise usage("--joint and a twist exclude one another")
    if joints:
        speeds = parse_joints([text.removesuffix("/s") for text in joints], arm.joints)
        return JogCommand(name=tuple(speeds), velocity=tuple(speeds.values()))
    angular = tuple(math.radians(value) for value in turn)
    return JogCommand(linear=tuple(twist), angular=angular, frame=arm.tool_frame if in_tool else "")


def words() -> Words:
    """Joints after their option."""
    from services.cli.device_words import arm

    known = arm()
    return {} if known is None else {"--joint": [f"{joint.name}=" for joint in known.joints]}


COMMANDS = (
    Command(("jog",), "move by hand, with keys or for a given time; letting go stops the arm", jog, jog_options,
            words_after=words),
)  # fmt: skip
