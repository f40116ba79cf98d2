"""`gemelo import`: from a URDF or an export's folder to urdf/<name>/, each step with its time."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from services.arm.checks.check import check
from services.arm.checks.findings import Finding, Severity
from services.arm.errors import DescriptionError, suggestion
from services.arm.model.description import load_arm
from services.arm.model.urdf import UrdfModel
from services.arm.model.virtual_drive import NO_MOTORS, driven_joints
from services.robot_import.drive import ask_drives, speed_lines
from services.robot_import.limits import ask_limits
from services.robot_import.link_mending import shapeless
from services.robot_import.mended import Mended
from services.robot_import.mending import mend, safe_name
from services.robot_import.parts import MOTORS, USUAL_DRIVER, DriverPart, MotorPart, driver_named, motor_named
from services.robot_import.questions import Questions, answers_text, read_answers, yes_or_no
from services.robot_import.robot_folder import Description, step, write_robot
from services.robot_import.source import find_source
from services.robot_import.standing import ask_who_stands
from services.robot_import.tool_link import other_tools, tool_link
from services.robot_import.trial import trial_findings

ANSWERS_FILE = "import.toml"
XACRO = "xacro."  # before the names of its arguments, in a file of answers
LONGEST_NAME = 60  # letters: with what others add it is a folder's name everywhere
NOT_IN_A_NAME = r"[^A-Za-z0-9_-]+"


@dataclass(frozen=True)
class ImportOptions:
    """What a person gave on the command line."""

    source: Path
    output: Path  # folder of robots
    name: str = ""
    yes: bool = False
    force: bool = False
    answers: Path | None = None
    motor: str = ""
    driver: str = ""
    xacro: Mapping[str, str] = field(default_factory=dict)  # arguments by name


def import_robot(options: ImportOptions) -> Path:
    """Writes the robot's folder and returns it; raises `DescriptionError`, and leaves what was there as it was."""
    answers = read_answers(options.answers) if options.answers else {}
    questions = Questions(
        {**answers, **{f"{XACRO}{name}": value for name, value in options.xacro.items()}}, options.yes
    )
    mended = _mended(options, questions)
    wanted = options.name or mended.xml.root.get("name") or options.source.stem
    name = safe_name(wanted[:LONGEST_NAME], set(), NOT_IN_A_NAME)
    folder = options.output / name
    _require_free(folder, options)
    description = _described(name, mended, options, questions)
    _require_all_asked(questions, options)
    with _replaced(folder) as building:
        write_robot(building, description)
        (building / ANSWERS_FILE).write_text(answers_text(questions.answers), encoding="utf-8")
        with step("gemelo check, with plans between random configurations"):
            known = {(each.subject, each.message) for each in description.mended.findings()}
            _require_well([each for each in check(building) if (each.subject, each.message) not in known])
            _require_well([_in_folder(each, building, folder) for each in trial_findings(building)])
    arm = load_arm(folder)
    print("\n".join(speed_lines(arm) if arm.has_motors else [f"{name}: {NO_MOTORS}"]))
    return folder


def _mended(options: ImportOptions, questions: Questions) -> Mended:
    """The source, mended and with limits; nothing is asked where it has errors."""
    with step("reading the source and its meshes"):
        source = find_source(options.source, questions.given_below(XACRO), partial(_ask_before_expanding, questions))
        trial = mend(source)
        ask_limits(trial, Questions({}, takes_defaults=True))
        _require_importable([*shapeless(trial), *trial.findings()])
    mended = mend(source)
    ask_limits(mended, questions)
    _show(mended.findings())
    return mended


def _ask_before_expanding(questions: Questions, xacro: Path) -> None:
    """Raises `DescriptionError` where the person does not want a xacro file to be expanded."""
    question = f"{xacro.name} is a xacro file, which is a program: expand it, in a sandbox?"
    if not questions.ask_somebody("expand_xacro", question, "yes", yes_or_no):
        raise DescriptionError(f"{xacro}: it was not expanded, and nothing was imported")


def _described(name: str, mended: Mended, options: ImportOptions, questions: Questions) -> Description:
    """With what a URDF cannot say, asked."""
    motor = _part(motor_named, options.motor or MOTORS[0].name)
    driver = _part(driver_named, options.driver or USUAL_DRIVER)
    tool = questions.ask("tool_frame", "the tool's link", tool_link(mended.model), _link_of(mended.model))
    said = len(mended.notes)
    others = other_tools(mended.model, tool)
    if others:
        message = f'the goals are about "{tool}", though {_quoted(others)} could be the tool too'
        mended.warn(mended.xml.root, "robot", message, "`tool_frame` in robot.toml, or in --answers, names another")
    ask_who_stands(mended, tool, questions)
    _show(mended.notes[said:])
    joints = driven_joints(mended.model)
    if not joints:
        raise DescriptionError(f"{mended.source.urdf}: it has no joint that moves, so it is no arm: name another file")
    has_motors = questions.ask(
        "motors", "does it have motors to drive (no: to plan and look at only)?",
        "yes" if options.motor or options.driver else "no", yes_or_no,
    )  # fmt: skip
    drives = ask_drives(joints, questions, motor, driver) if has_motors else []
    return Description(mended, name, _base(mended.model), tool, joints, drives)


@contextmanager
def _replaced(folder: Path) -> Iterator[Path]:
    """An empty folder that takes the place of `folder` where the block succeeds, and is removed where it does not."""
    building = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(building, ignore_errors=True)
    building.mkdir(parents=True)
    try:
        yield building
        shutil.rmtree(folder, ignore_errors=True)
        building.rename(folder)
    finally:
        shutil.rmtree(building, ignore_errors=True)


def _part(named: Callable[[str], MotorPart | DriverPart], text: str) -> str:
    try:
        return str(named(text).name)
    except ValueError as error:
        raise DescriptionError(str(error)) from error


def _require_importable(findings: Sequence[Finding]) -> None:
    """Raises `DescriptionError` after all findings are said, where one of them is an error."""
    errors = [each for each in findings if each.severity is Severity.ERROR]
    if errors:
        _show(findings)
        count = "the error above has" if len(errors) == 1 else f"the {len(errors)} errors above have"
        raise DescriptionError(f"{count} no one answer: correct the source, then import it again")


def _require_all_asked(questions: Questions, options: ImportOptions) -> None:
    """Raises `DescriptionError` where the file of answers has a key that nothing asks for: it is misspelt."""
    unused = questions.unused()
    if unused:
        raise DescriptionError(f"{options.answers}: nothing asks for {', '.join(unused)}: correct or remove it")


def _require_well(findings: Sequence[Finding]) -> None:
    """Raises `DescriptionError` where the finished folder has an error; says the rest, without notes."""
    _show([each for each in findings if each.severity is not Severity.NOTE])
    if any(each.severity is Severity.ERROR for each in findings):
        raise DescriptionError("the finished robot has the errors above; nothing is written")


def _in_folder(finding: Finding, building: Path, folder: Path) -> Finding:
    """The finding about `building` as one about `folder`, which takes its name."""
    return replace(finding, remedy=finding.remedy.replace(str(building), str(folder)))


def _show(findings: Sequence[Finding]) -> None:
    for finding in findings:
        mends = finding.severity is Severity.NOTE
        print(str(finding).replace("note: ", "mended: ", 1) if mends else finding)


def _require_free(folder: Path, options: ImportOptions) -> None:
    if not folder.exists():
        return
    if not options.force:
        raise DescriptionError(f"{folder} is there already: give --force to replace it, or --name for another")
    if folder.resolve() in (options.source.resolve(), *options.source.resolve().parents):
        raise DescriptionError(f"{options.source} lies in {folder}, which is to be replaced: give --name for another")
    if not folder.is_dir() or (any(folder.iterdir()) and not (folder / "robot.urdf").is_file()):
        raise DescriptionError(f"{folder} is no robot's folder, --force does not replace it: give --name for another")


def _link_of(model: UrdfModel) -> Callable[[str], str]:
    def read(text: str) -> str:
        if text not in model.link_names:
            raise ValueError(f"no such link{suggestion(text, model.link_names)}")
        return text

    return read


def _base(model: UrdfModel) -> str:
    children = {joint.child for joint in model.joints}
    return next(link for link in model.link_names if link not in children)


def _quoted(names: list[str]) -> str:
    return ", ".join(f'"{name}"' for name in names)
