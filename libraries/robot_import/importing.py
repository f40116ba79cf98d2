"""`gemelo import`: from a URDF or an export's folder to urdf/<name>/, each step with its time; `gemelo check` of such a
source does the same in a folder that is removed, so that both find the same."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from gemelo.libraries.arm.checks.check import check
from gemelo.libraries.arm.checks.findings import Finding, Severity, error
from gemelo.libraries.arm.errors import DescriptionError, Subject, wrong_file
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.model.virtual_drive import NO_MOTORS
from gemelo.libraries.robot_import.drive import speed_lines
from gemelo.libraries.robot_import.questions import Questions, answers_text, read_answers, yes_or_no
from gemelo.libraries.robot_import.robot_folder import Description, step, write_robot
from gemelo.libraries.robot_import.source import RobotSource, find_source
from gemelo.libraries.robot_import.survey import Survey, surveyed
from gemelo.libraries.robot_import.trial import trial_findings
from gemelo.schemas.reasons import Reason, because

ANSWERS_FILE = "import.toml"
XACRO = "xacro."  # before the names of its arguments, in a file of answers


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
    say: Callable[[Reason], str] = str  # the sentence of a reason, in the language of the command line


def import_robot(options: ImportOptions) -> Path:
    """Writes the robot's folder and returns it; raises `DescriptionError`, and leaves what was there as it was."""
    questions = _questions(options)
    with step(because("import.step.source"), options.say):
        source = _source(options, questions)
        _require_importable(_surveyed(source, options, questions.rehearsal()).findings, options)
    survey = _surveyed(source, options, questions)
    _show(survey.findings, options)
    description = survey.description
    if description is None:
        raise DescriptionError(because("import.ended.answers"))
    folder = options.output / description.name
    _require_free(folder, options)
    with TemporaryDirectory(prefix="gemelo_import_") as temporary:
        building = Path(temporary) / description.name
        findings = built(building, description)
        _require_all_asked(questions, options)
        _require_well([_in_folder(each, building, folder) for each in findings], options)
        (building / ANSWERS_FILE).write_text(answers_text(questions.answers), encoding="utf-8")
        _publish(building, folder)
    arm = load_arm(folder)
    if arm.has_motors:
        print("\n  ".join(map(options.say, speed_lines(arm))))
    else:
        print(f"{description.name}: {options.say(NO_MOTORS)}")
    return folder


def source_findings(options: ImportOptions) -> list[Finding]:
    """All that an import with defaults finds, errors first; its folder is built and removed. Raises `DescriptionError`
    where there is nothing to read."""
    questions = _questions(options)
    survey = _surveyed(_source(options, questions), options, questions)
    if survey.description is None:
        return survey.findings
    with TemporaryDirectory(prefix="gemelo_check_") as temporary:
        building = Path(temporary) / survey.description.name
        found = [
            *survey.findings,
            *(_in_folder(each, building, options.source) for each in built(building, survey.description)),
        ]
    return sorted(found, key=lambda each: list(Severity).index(each.severity))


def built(building: Path, description: Description) -> list[Finding]:
    """Fills `building` with the robot, and returns what is found of it that the survey has not said; an error where it
    cannot be built."""
    known = {(each.subject, each.message) for each in description.mended.findings()}
    building.mkdir(parents=True)
    source = description.mended.source
    try:
        findings = write_robot(building, description)
    except DescriptionError as why:
        found = error(source.label, Subject("robot"), why.reason)
        return [_in_folder(found, building, Path(source.label).parent)]
    if any(each.severity is Severity.ERROR for each in findings):
        return findings
    with step(because("import.step.check"), description.mended.questions.say):
        findings += [
            each
            for each in check(building)
            if (each.subject, each.message) not in known and each.severity is not Severity.NOTE
        ]
        if not any(each.severity is Severity.ERROR for each in findings):
            findings += trial_findings(building)
    return findings


def _questions(options: ImportOptions) -> Questions:
    answers = read_answers(options.answers) if options.answers else {}
    arguments = {f"{XACRO}{name}": value for name, value in options.xacro.items()}
    return Questions({**answers, **arguments}, options.yes, options.say)


def _source(options: ImportOptions, questions: Questions) -> RobotSource:
    ask = partial(_ask_before_expanding, questions)
    return find_source(options.source, questions.given_below(XACRO), ask, options.say)


def _surveyed(source: RobotSource, options: ImportOptions, questions: Questions) -> Survey:
    return surveyed(source, questions, options.name, options.motor, options.driver)


def _ask_before_expanding(questions: Questions, xacro: Path) -> None:
    """Raises `DescriptionError` where the person does not want a xacro file to be expanded."""
    question = because("import.ask.xacro", file=xacro.name)
    if not questions.ask_somebody("expand_xacro", question, "yes", yes_or_no):
        raise wrong_file(xacro, because("import.xacro.not_wanted"))


def _publish(building: Path, folder: Path) -> None:
    """The finished `building` in the place of `folder`: copied beside it first, since it may be on another disk."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    beside = folder.with_name(f".{folder.name}.partial")
    shutil.rmtree(beside, ignore_errors=True)
    try:
        shutil.copytree(building, beside)
        shutil.rmtree(folder, ignore_errors=True)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _require_importable(findings: Sequence[Finding], options: ImportOptions) -> None:
    """Raises `DescriptionError` after all findings are said, where one of them is an error."""
    errors = [each for each in findings if each.severity is Severity.ERROR]
    if errors:
        _show(findings, options)
        why = because("import.ended.error") if len(errors) == 1 else because("import.ended.errors", count=len(errors))
        raise DescriptionError(why)


def _require_all_asked(questions: Questions, options: ImportOptions) -> None:
    """Raises `DescriptionError` where the file of answers has a key that nothing asks for: it is misspelt."""
    unused = questions.unused()
    if unused:
        raise wrong_file(str(options.answers), because("import.answers.unused", *unused))


def _require_well(findings: Sequence[Finding], options: ImportOptions) -> None:
    """Raises `DescriptionError` where the finished folder has an error; says all of them."""
    for each in findings:
        print(options.say(each.reason))
    if any(each.severity is Severity.ERROR for each in findings):
        raise DescriptionError(because("import.ended.finished"))


def _in_folder(finding: Finding, building: Path, folder: Path) -> Finding:
    """The finding about `building` as one about `folder`, which takes its name."""
    old, new = (msgspec.json.encode(str(path))[1:-1] for path in (building, folder))
    return msgspec.json.decode(msgspec.json.encode(finding).replace(old, new), type=Finding)


def _show(findings: Sequence[Finding], options: ImportOptions) -> None:
    for finding in findings:
        reason = finding.reason
        if finding.severity is Severity.NOTE:
            reason = msgspec.structs.replace(reason, values={**reason.values, "severity": "mended"})
        print(options.say(reason))


def _require_free(folder: Path, options: ImportOptions) -> None:
    if not folder.exists():
        return
    if not options.force:
        raise DescriptionError(because("import.folder.exists", folder=str(folder)))
    if folder.resolve() in (options.source.resolve(), *options.source.resolve().parents):
        raise DescriptionError(because("import.folder.source", source=str(options.source), folder=str(folder)))
    if not folder.is_dir() or (any(folder.iterdir()) and not (folder / "robot.urdf").is_file()):
        raise DescriptionError(because("import.folder.other", folder=str(folder)))
