"""`gemelo verify`: the shortest trip that verifies joints by their switches, and what the ledger says after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

import gemelo
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, joint_of
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.motion.home import home_reason
from gemelo.tools.cli.parser import Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Arm


class VerifyReport(msgspec.Struct, frozen=True, kw_only=True):
    """What `gemelo verify --json` prints."""

    passed: tuple[str, ...] = ()
    homed: tuple[str, ...] = ()
    without_switch: tuple[str, ...] = ()
    steps_off: dict[str, int] = {}  # of joints whose place had been known before
    took_s: float = 0.0
    confidence: float = 0.0  # 0 to 1, of the arm after it
    tool_bound: float = 0.0  # [m] at `level`
    level: float = 0.95


def add_options(parser: Parser) -> None:
    """Adds the joints and --json."""
    parser.add_argument("joints", metavar="JOINT", nargs="*", help="all, if none is named")
    json_option(parser)


def run(options: Options) -> ExitCode:
    """Verifies the joints named; a wrong name is refused before the stack is asked."""
    robot = load_robot()
    names = [joint_of(robot.description, name).name for name in options.joints]
    with connect_arm(robot) as arm:
        return verify(arm, names, options.json)


def verify(arm: Arm, names: list[str], as_json: bool) -> ExitCode:
    """Goes on the trip and prints what it has found."""
    try:
        found = arm.verify(*names, on_progress=None if as_json else _tell)
    except (gemelo.Refused, gemelo.Aborted) as error:
        raise CommandError(error) from error
    ledger = arm.ledger
    report = VerifyReport(
        passed=found.passed, homed=found.homed, without_switch=found.without_switch, steps_off=found.steps_off,
        took_s=round(found.took, 3), confidence=ledger.confidence, tool_bound=ledger.tool_bound, level=ledger.level,
    )  # fmt: skip
    print(msgspec.json.encode(report).decode() if as_json else text_of(report))
    return ExitCode.OK


def text_of(report: VerifyReport) -> str:
    """A line for each joint, and what is sure now."""
    lines = [_passed(name, report.steps_off.get(name, 0)) for name in report.passed]
    lines += [home_reason(name, report.steps_off.get(name)) for name in report.homed]
    lines += [because("homing.verify.no_switch", joint=name) for name in report.without_switch]
    count = len(report.passed) + len(report.homed)
    verified = because(
        "homing.verified",
        count=count, of=count + len(report.without_switch), time=report.took_s,
        sure=f"{int(1000.0 * report.confidence) / 10.0:g}", bound=1e3 * report.tool_bound, level=report.level,
    )  # fmt: skip
    return "\n".join(map(sentence, (*lines, verified)))


def _passed(name: str, steps: int) -> Reason:
    return because("homing.passed.off", joint=name, steps=steps) if steps else because("homing.passed", joint=name)


def _tell(what: Reason) -> None:
    print(sentence(what), flush=True)
