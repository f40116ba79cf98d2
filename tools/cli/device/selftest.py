"""`gemelo device selftest`: an arm that is wired for the first time, joint by joint, with a person who looks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, joint_of
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.device import selftest_checks as checks
from gemelo.tools.cli.device.selftest_person import Answer, Left, Outcome, Person
from gemelo.tools.cli.parser import Choices, Options, Parser

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.libraries.arm.model.description import ArmDescription, Joint

LARGEST_CURRENT = 20.0  # [A] chosen: no driver of such motors gives more


def add_options(parser: Parser) -> None:
    """Adds the joints, the currents and --apply."""
    parser.add_argument("joints", metavar="JOINT", nargs="*", help="all of them, if none is named")
    parser.add_argument(
        "--current", nargs="+", default=[], metavar="JOINT=AMPERES", help="to note beside its driver, as q1=1.8"
    )
    parser.add_argument(
        "--apply", action="store_true", help="write what was found into robot.toml: a motor that turns the other way"
    )
    parser.epilog = (
        "It goes through drivers, switches and emergency stop, then through each joint: one step, one degree, a ramp "
        f"to full speed. Answers are lines of standard input. Nothing is written without --apply.\n\n{parser.epilog}"
    )


def choices(robot: Robot | None) -> Choices:
    """The joints."""
    return {} if robot is None else {"": list(robot.description.joint_names)}


def run(options: Options) -> ExitCode:
    """Checks, reports, and writes what is to be written; exit code 1 where something does not go as it should."""
    robot = load_robot()
    joints = [joint_of(robot.description, name) for name in options.joints] or list(robot.description.joints)
    currents = currents_of(robot.description, options.current)
    person = Person()
    with connect_arm(robot) as arm:
        person.say(because("selftest.begin", robot=arm.name))
        outcomes = made(arm, joints, person)
    for each in outcomes:
        print(report_line(each))
    turned = tuple(
        str(each.check.values["joint"]) for each in outcomes if each.answer is Answer.WRONG_WAY
    )  # of the check of its direction
    finish(robot.description.robot_path, turned, currents, options.apply, person)
    return ExitCode.OK if all(each.is_well for each in outcomes) else ExitCode.FAILED


def made(arm: Arm, joints: Sequence[Joint], person: Person) -> list[Outcome]:
    """The checks that were made, up to the last or to where the person has left."""
    outcomes: list[Outcome] = []
    try:
        if person.ask(because("selftest.ask.clear"), (Answer.YES, Answer.NO)) is not Answer.YES:
            return outcomes
        for each in every_check(arm, joints, person):
            outcomes.append(each)
            if each.remedy is not None:
                person.say(each.remedy)
    except Left:
        person.say(because("selftest.left"))
    return outcomes


def every_check(arm: Arm, joints: Sequence[Joint], person: Person) -> Iterator[Outcome]:
    """In their order: what later ones need comes first."""
    yield from checks.drivers(arm, person)
    yield from checks.switches(arm, person)
    if checks.stand(arm, person):
        for joint in joints:
            yield from checks.joint(arm, joint, person)


def report_line(each: Outcome) -> str:
    """As "  ok       brazo_joint: one step"."""
    word = because("selftest.well") if each.answer is Answer.YES else because("selftest.not_well")
    word = because("selftest.skipped") if each.answer is Answer.SKIP else word
    return f"  {sentence(word):10} {sentence(each.check)}"


def finish(path: Path, turned: tuple[str, ...], currents: dict[str, float], is_applied: bool, person: Person) -> None:
    """Writes the joints `turned` and the `currents` [A] into robot.toml at `path`, or says that it would."""
    if not turned and not currents:
        return
    joints = tuple(dict.fromkeys((*turned, *currents)))
    if not is_applied:
        return person.say(because("selftest.file.not_written", joints=joints, file=str(path)))
    from gemelo.tools.cli.device.selftest_file import write_findings  # tomlkit takes 40 ms, for this alone

    write_findings(path, turned, currents, date.today())
    person.say(because("selftest.file.written", joints=joints, file=str(path)))


def currents_of(arm: ArmDescription, words: Sequence[str]) -> dict[str, float]:
    """[A] by joint, of words as q1=1.8; raises `CommandError`."""
    found = {}
    for word in words:
        name, _, number = word.partition("=")
        joint = joint_of(arm, name)
        try:
            current = float(number.removesuffix("A"))
        except ValueError:
            current = -1.0
        if not 0.0 < current <= LARGEST_CURRENT:
            raise CommandError(
                because("selftest.current", word=word, most=LARGEST_CURRENT, joint=joint.name), ExitCode.USAGE
            )
        found[joint.name] = current
    return found
