"""`gemelo home`: homes joints on their switches and shows the phase of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.api.homing_report import HOME, WAITS
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.tools.cli.common.errors import CommandError, ExitCode, joint_of
from gemelo.tools.cli.common.language import sentence, word
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm, HomingProgress, HomingReport, Robot


def add_options(parser: Parser) -> None:
    """Adds the joints and --json."""
    parser.add_argument("joints", metavar="JOINT", nargs="*", help="all that have a home switch, if none is named")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Homes the joints named; a wrong name is refused before the stack is asked."""
    robot = load_robot()
    joints = [joint_of(robot.description, name) for name in options.joints]
    with connect_arm(robot) as arm:
        return home(arm, [joint.name for joint in joints], options.json)


def choices(robot: Robot | None) -> Choices:
    """The joints that have a home switch."""
    if robot is None:
        return {}
    return {"": [joint.name for joint in robot.description.joints if joint.drive.homing is not None]}


class HomeReport(msgspec.Struct, frozen=True, kw_only=True):
    """The end of a homing; --json prints it."""

    homed: tuple[str, ...] = ()
    steps_off: dict[str, int] = {}  # of joints whose place had been known before
    took_s: float = 0.0
    interrupted: bool = False
    reason: str = ""  # why not all are home


def home(arm: Arm, names: Sequence[str], as_json: bool = False) -> ExitCode:
    """Homes the joints named, or all that can; raises `CommandError` with the reason if not all are home."""
    joints = [joint_of(arm.description, name).name for name in names]
    screen = Screen(is_quiet=as_json)
    is_interrupted = False
    try:
        ended = arm.home(*joints, on_progress=screen.show, on_cancel=screen.on_cancel)
    except gemelo.Refused as error:
        raise CommandError(error) from error
    except (gemelo.Aborted, gemelo.Interrupted) as error:
        if error.homing is None:
            raise
        ended, is_interrupted = error.homing, isinstance(error, gemelo.Interrupted)
    finally:
        screen.clear()
    report = _report_of(ended, is_interrupted)
    if as_json:
        print(msgspec.json.encode(report).decode())
    if report.reason:
        code = ExitCode.CANCELLED if is_interrupted else ExitCode.FAILED
        raise CommandError(because("homing.ended", ended.why or plain(report.reason), time=ended.took), code)
    if not as_json:
        count = len(report.homed)
        print(sentence(because("homing.done", homed=count, count=count, time=report.took_s)))
    return ExitCode.OK


def _report_of(ended: HomingReport, is_interrupted: bool) -> HomeReport:
    return HomeReport(
        homed=ended.homed,
        steps_off=ended.steps_off,
        took_s=round(ended.took, 3),
        interrupted=is_interrupted,
        reason=str(ended.why or ""),
    )


class Screen:
    """A line for every joint whose phase has changed, and on a terminal the phases of all below."""

    def __init__(self, is_quiet: bool) -> None:
        self._block = LiveBlock(False if is_quiet else None)
        self._is_quiet = is_quiet
        self._shown: Mapping[str, str] = {}

    def show(self, progress: HomingProgress) -> None:
        """Prints what is new since the last call."""
        if self._is_quiet:
            return
        changed = {name: phase for name, phase in progress.items() if self._shown.get(name, WAITS) != phase}
        self._shown = progress
        for name, phase in changed.items():
            if phase == HOME:
                self._block.say(sentence(home_reason(name, progress.steps_off.get(name))))
            elif not self._block.is_live:
                self._block.say(sentence(because("homing.phase", joint=name, phase=phase)))
        rows = [f"  {name:<20} {word('homing', phase)}" for name, phase in progress.items()]
        heading = sentence(because("homing.running", time=progress.elapsed))
        self._block.draw("\n".join([heading, *rows]))

    def on_cancel(self) -> None:
        """Says what Ctrl-C has done."""
        if not self._is_quiet:
            self._block.say(sentence(because("homing.stopping")))

    def clear(self) -> None:
        """Removes the phases from the terminal."""
        self._block.say()


def home_reason(name: str, steps_off: int | None) -> Reason:
    """A joint that is home; `steps_off` is how far its counter was from its true position [steps]."""
    if steps_off is None:
        return because("homing.home", joint=name)
    if abs(steps_off) <= 1:
        return because("homing.home.near" if steps_off else "homing.home.right", joint=name)
    return because("homing.home.off", joint=name, steps=steps_off)
