"""`gemelo jog`: moves the arm by hand or for a given time; the arm stops when the commands stop."""

from __future__ import annotations

import shutil
import textwrap
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import gemelo
from gemelo.schemas.planning import JogCommand, JogLimit, JogStatus
from gemelo.schemas.reasons import because, plain
from gemelo.schemas.topics import JOG_STATUS, JOINT_STATES
from gemelo.tools.cli.bus.request_text import degrees, joints_text, millimetres, understood
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.language import sentence, translated
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.terminal import LiveBlock, two_stage_interrupt
from gemelo.tools.cli.common.units import SPEED_OF, angular_speed, parse_joints, positive_seconds, show, speed
from gemelo.tools.cli.motion.jog_keys import JogKeys, keyboard, require_terminal
from gemelo.tools.cli.parser import Choices, Options, Parser

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.libraries.arm.model.description import ArmDescription

PERIOD = 0.02  # [s] between two commands while a key is held
DRAWN = 0.1  # [s] between two drawings
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
  gemelo jog --twist 50mm/s 0 0 --frame tool --for 1      # along the tool's x
  gemelo jog --turn 0 0 10deg/s --for 500ms"""


def add_options(parser: Parser) -> None:
    """Adds joint speeds, twist and duration."""
    parser.epilog = EXAMPLES
    parser.add_argument(
        "--joint", nargs="+", default=[], metavar="JOINT=SPEED", help="10deg/s, 0.2rad/s, 5mm/s; several move together"
    )
    twist, turn = "of the tool, as 50mm/s or 0.05", "at which the tool turns, as 10deg/s or 0.2rad/s"
    parser.add_argument("--twist", nargs=3, type=speed, default=[], metavar=("VX", "VY", "VZ"), help=twist)
    parser.add_argument("--turn", nargs=3, type=angular_speed, default=[], metavar=("WX", "WY", "WZ"), help=turn)
    parser.add_argument(
        "--frame",
        choices=("base", "tool"),
        default="base",
        help="whose axes --twist and --turn are along; the base's, if not said",
    )
    parser.add_argument(
        "--for",
        dest="seconds",
        type=positive_seconds,
        metavar="TIME",
        help="how long it moves with --joint, --twist or --turn, as 1 or 500ms",
    )


def run(options: Options) -> ExitCode:
    """Jogs with the keys, or as the options say."""
    by_hand = not (options.joint or options.twist or options.turn)
    if by_hand and options.seconds is None:
        require_terminal("jog_with_options")
        with connect_arm() as arm:
            return jog_by_hand(arm)
    if by_hand or options.seconds is None:
        raise usage(because("cli.jog.which"))
    robot = load_robot()
    command = command_of(robot.description, options.joint, options.twist, options.turn, options.frame == "tool")
    print(understood(for_time(command_text(command, robot.description), options.seconds)), flush=True)
    with connect_arm(robot) as arm:
        return jog_for(arm, command, options.seconds)


def choices(robot: Robot | None) -> Choices:
    """The joints, after --joint."""
    return {} if robot is None else {"--joint": [f"{joint.name}=" for joint in robot.description.joints]}


def command_of(
    arm: ArmDescription, joints: Sequence[str], twist: Sequence[float], turn: Sequence[float], in_tool: bool
) -> JogCommand:
    """The command for joint speeds as text, or for a twist of the tool along its own axes if `in_tool`.

    `twist` (3,) is in [m/s], `turn` (3,) in [rad/s]. Raises `CommandError` if both forms are given.
    """
    if joints and (twist or turn):
        raise usage(because("cli.jog.both"))
    if joints:
        speeds = parse_joints(joints, arm.joints, SPEED_OF)
        return JogCommand(name=tuple(speeds), velocity=tuple(speeds.values()))
    return JogCommand(linear=tuple(twist), angular=tuple(turn), frame=arm.tool_frame if in_tool else "")


def command_text(command: JogCommand, arm: ArmDescription) -> str:
    """The command as a line, in degrees and millimetres a second."""
    if command.name:
        return joints_text(command.name, command.velocity, arm, "/s")
    parts = [because("understood.jog.tool", speed=millimetres(command.linear, "/s"))] if command.linear else []
    parts += [because("understood.jog.turn", speed=degrees(command.angular, "/s"))] if command.angular else []
    axes = because("understood.jog.axes", frame=command.frame) if command.frame else because("understood.jog.axes.base")
    return ", ".join(map(sentence, (*parts, axes)))


def for_time(text: str, seconds: float) -> str:
    """The line of a command that moves for so long [s]."""
    return sentence(because("understood.jog.time", text=text, time=seconds))


class Position:
    """The newest position of tool and joints, as a line."""

    def __init__(self, arm: Arm) -> None:
        from gemelo.libraries.arm.kinematics.kinematics import Kinematics  # loads numpy

        self._arm, self._kinematics = arm.description, Kinematics(arm.description)
        self._states = arm.node.latest(JOINT_STATES)

    @property
    def line(self) -> str:
        """`tool x 250.0  y 150.0  z 100.0 mm; brazo_joint 30.00 deg, ...`"""
        state = self._states.message
        found = {} if state is None else dict(zip(state.name, state.position, strict=False))
        if any(name not in found for name in self._arm.joint_names):
            return sentence(because("understood.jog.no_state"))
        x, y, z = (1e3 * value for value in self._kinematics.tool([found[n] for n in self._arm.joint_names]).position)
        joints = ", ".join(f"{joint.name} {show(found[joint.name], joint.unit, 2)}" for joint in self._arm.joints)
        return sentence(because("understood.jog.at", x=x, y=y, z=z, joints=joints))


def jog_for(arm: Arm, command: JogCommand, seconds: float) -> ExitCode:
    """Sends `command` for `seconds` [s], waits until the arm rests and prints where.

    Raises `CommandError` with the reason if the planner refuses.
    """
    position = Position(arm)
    limits: dict[tuple[str, str], JogLimit] = {}  # by check and subject, the newest of each
    code = ExitCode.OK

    def collect(status: JogStatus) -> None:
        limits.update({(limit.check, limit.subject): limit for limit in status.limits})

    try:
        last = arm.jog(command, duration=seconds, on_progress=collect)
        collect(last or JogStatus())
    except gemelo.Interrupted:
        code = ExitCode.CANCELLED
    except gemelo.Refused as error:
        raise CommandError(error) from error
    print(position.line)
    for limit in limits.values():
        print(_limited_by(limit))
    return code


def jog_by_hand(arm: Arm) -> ExitCode:
    """Jogs while keys are held, until one that leaves."""
    with keyboard() as typed, two_stage_interrupt() as interrupt:
        position, status = Position(arm), arm.node.latest(JOG_STATUS)
        keys, block = JogKeys(arm.description.joints, arm.tool_frame), LiveBlock()
        block.say(translated(HELP))
        drawn = 0.0
        while not (keys.wants_to_leave or interrupt.is_set):
            now = time.monotonic()
            keys.press(typed(PERIOD), now)
            command = keys.command(now)
            if command is not None:
                with suppress(gemelo.Refused):  # `status_lines` says why
                    arm.jog(command)
            if now - drawn >= DRAWN:
                drawn = now
                block.draw(_folded([keys.line, position.line, *status_lines(status.message)]))
        with suppress(gemelo.Refused):
            arm.end_jog()
        block.say(position.line)
    return ExitCode.OK


def status_lines(status: JogStatus | None) -> list[str]:
    """The planner's newest status as lines."""
    if status is None or not (status.active or status.limited_by):
        return [sentence(because("understood.jog.rest"))]
    if not status.active:
        return [sentence(because("refused.plan", status.why or plain(status.limited_by)))]
    share = sentence(because("understood.jog.share", share=status.scale))
    if not status.limits:
        return [share]
    return [share, *(f"  {_limited_by(limit)}" for limit in status.limits)]


def _limited_by(limit: JogLimit) -> str:
    """In the language of the command line; of an older planner its own sentence."""
    return sentence(because("jog.limited", limit.why or plain(limit.message)))


def _folded(lines: Iterable[str]) -> str:
    """The lines wrapped to the width of the terminal: a remedy must not be cut off."""
    width = max(20, shutil.get_terminal_size().columns - 1)
    return "\n".join(part for line in lines for part in textwrap.wrap(line, width, subsequent_indent="  "))
