"""`gemelo program`: lists, checks, runs and exports the programs of the deployment's folder."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import gemelo
from gemelo.programs import (
    CheckedLeg,
    Points,
    Program,
    ProgramCheck,
    ProgramError,
    ProgramRun,
    Programs,
    RunState,
    RunStatus,
    StepPath,
    check_program,
    export_script,
    find_mistakes_in_file,
    parse_path,
    path_text,
    programs_folder,
)
from gemelo.schemas.reasons import because, plain
from gemelo.tools.cli.common.errors import ExitCode, hint_of, text_of, usage
from gemelo.tools.cli.common.language import columns, sentence, word
from gemelo.tools.cli.common.session import connect_arm, load_robot, reported
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

PLAIN = re.compile(r"[\w.-]+")
BRAKING = 10.0  # [s] that the arm may take to come to rest after Ctrl-C


def name_option(parser: Parser) -> None:
    """Adds the program's name."""
    parser.add_argument("name", metavar="NAME", help="a program of `gemelo program list`")


def check_options(parser: Parser) -> None:
    """Adds name, first step and --json."""
    name_option(parser)
    parser.add_argument("--from", dest="first", default="", metavar="STEP", help="begin there, as 3 or 3.1")
    json_option(parser)


run_options = check_options


def export_options(parser: Parser) -> None:
    """Adds name and file."""
    name_option(parser)
    parser.add_argument("file", metavar="FILE", nargs="?", default="-", help="to write; standard output if left out")


def choices(robot: gemelo.Robot | None) -> Choices:
    """The names of the programs; only those that a shell takes as one plain word."""
    return {} if robot is None else {"": [name for name in _programs(robot) if PLAIN.fullmatch(name)]}


def run_list(options: Options) -> ExitCode:
    """Every program with its steps, and the mistakes of its file."""
    robot = load_robot()
    programs = _programs(robot)
    with reported(robot):
        points = Points.load(programs.folder, robot.description)
        rows = [_row(programs, name, robot, points) for name in programs]
    if options.json:
        print(json.dumps({"folder": str(programs.folder), "programs": rows}))
    elif not rows:
        print(sentence(because("program.list.none", folder=str(programs.folder))))
    else:
        print(table((*columns("program", "steps", "robot"), ""), [_cells(row) for row in rows]))
    return ExitCode.OK


def run_check(options: Options) -> ExitCode:
    """Plans every leg from the end of the one before; exit code 1 where the program cannot run."""
    robot = load_robot()
    program, points, programs = _load(options.name, robot)
    first = _first(options.first, robot)
    shown = None if options.json else _show_leg
    with connect_arm(robot) as arm:
        check = check_program(arm, program, points, programs, first=first, on_leg=shown)
    print(json.dumps(_check_fields(check)) if options.json else _verdict(check))
    return ExitCode.OK if check.ok else ExitCode.FAILED


def run_program(options: Options) -> ExitCode:
    """Runs to the end; at Ctrl-C the arm decelerates, and it is said where it stopped."""
    robot = load_robot()
    program, points, programs = _load(options.name, robot)
    first = _first(options.first, robot)
    with connect_arm(robot) as arm:
        run = ProgramRun(arm, program, points, programs, on_change=None if options.json else _show_steps())
        run.start(first)
        state = _await(run, options.json)
        joints = arm.joints
    if options.json:
        fields = {"status": state.status, "step": path_text(state.step), "done": state.done, "message": state.message}
        print(json.dumps({"program": program.name, **fields, "joints": joints}))
    else:
        print(_end_text(state, joints, robot))
    return EXIT_CODES[state.status]


def run_export(options: Options) -> ExitCode:
    """Writes the script into a file, or prints it."""
    robot = load_robot()
    program, points, programs = _load(options.name, robot)
    with reported(robot):
        script = export_script(program, points, programs)
    if options.file == "-":
        print(script, end="")
        return ExitCode.OK
    if "\0" in options.file:
        raise usage(because("cli.file.nul", file=repr(options.file)))
    try:
        Path(options.file).write_text(script, encoding="utf-8")
    except OSError as error:
        raise usage(because("cli.file.unwritable", file=str(options.file), error=str(error.strerror))) from error
    print(sentence(because("program.exported", file=str(options.file))))
    return ExitCode.OK


EXIT_CODES = {
    RunStatus.DONE: ExitCode.OK,
    RunStatus.FAILED: ExitCode.FAILED,
    RunStatus.STOPPED: ExitCode.CANCELLED,
}


def _programs(robot: gemelo.Robot) -> Programs:
    with reported(robot):
        return Programs(programs_folder(robot.deployment))


def _load(name: str, robot: gemelo.Robot) -> tuple[Program, Points, Programs]:
    """The program with all that it needs; raises `CommandError` with every mistake of the files."""
    programs = _programs(robot)
    with reported(robot):
        points = Points.load(programs.folder, robot.description)
        if name not in programs:
            programs.file(name)
            hint = hint_of(name, programs)
            raise usage(because("cli.program.unknown", hint, folder=str(programs.folder), name=name))
        if mistakes := find_mistakes_in_file(programs.file(name), robot.description, points, programs):
            raise ProgramError(mistakes)
        return programs[name], points, programs


def _first(text: str, robot: gemelo.Robot) -> StepPath:
    with reported(robot):
        return parse_path(text) if text else ()


def _row(programs: Programs, name: str, robot: gemelo.Robot, points: Points) -> dict[str, object]:
    mistakes = find_mistakes_in_file(programs.file(name), robot.description, points, programs)
    try:
        program = programs[name]
    except gemelo.Error:
        return {"name": name, "steps": None, "robot": "", "mistakes": [str(each) for each in mistakes]}
    steps = sum(1 for _ in program.all_steps())
    return {"name": name, "steps": steps, "robot": program.robot, "mistakes": [str(each) for each in mistakes]}


def _cells(row: dict[str, object]) -> tuple[str, str, str, str]:
    mistakes = row["mistakes"]
    assert isinstance(mistakes, list)
    code = "program.list.mistakes" if len(mistakes) > 1 else "program.list.mistake"
    said = sentence(because(code, count=len(mistakes), name=str(row["name"])))
    steps = row["steps"]
    robot = str(row["robot"] or word("program", "any"))
    return str(row["name"]), "?" if steps is None else str(steps), robot, said if mistakes else ""


def _show_leg(leg: CheckedLeg) -> None:
    where = ", ".join(path_text(path) for path in leg.paths)
    if leg.refusal is not None:
        said = text_of(leg.refusal)
    elif leg.margins:
        joint, margin = leg.tightest
        times = {"duration": leg.duration, "planned": 1e3 * leg.planning_time}
        said = sentence(because("program.leg", planner=leg.planner, joint=joint, margin=margin, **times))
    else:
        said = f"{leg.duration:.2f} s" if leg.duration else word("program", "ok")
    note = f" ({'; '.join(map(sentence, leg.notes))})" if leg.notes else ""
    print(f"{where}: {leg.text}: {said}{note}", flush=True)


def _verdict(check: ProgramCheck) -> str:
    notes = [check.left_out] if check.left_out is not None else []
    if check.ok:
        can = because("program.check.can", program=check.program, duration=check.duration)
        return "\n".join(map(sentence, (can, *notes)))
    cannot = because("program.check.cannot", program=check.program)
    mistakes = (mistake.reason for mistake in check.mistakes)
    return "\n".join(map(sentence, (cannot, *mistakes, *check.refusals, *notes)))


def _check_fields(check: ProgramCheck) -> dict[str, object]:
    legs = [
        {
            "steps": [path_text(path) for path in leg.paths],
            "text": leg.text,
            "duration_s": leg.duration,
            "times": leg.times,
            "margins": dict(leg.margins),
            "planner": leg.planner,
            "planned_s": leg.planning_time,
            "refusal": str(leg.refusal) if leg.refusal is not None else None,
            "note": leg.note,
        }
        for leg in check.legs
    ]
    return {"program": check.program, "ok": check.ok, "duration_s": check.duration, "legs": legs, "note": check.note}


def _show_steps() -> Callable[[RunState], None]:
    """Prints every step as it begins."""
    last: list[object] = []

    def show(state: RunState) -> None:
        now = [state.steps, state.rounds]
        if state.status is RunStatus.RUNNING and state.steps and now != last:
            last[:] = now
            step = {"step": ", ".join(path_text(path) for path in state.steps), "text": state.text}
            rounds = ".".join(str(each + 1) for each in state.rounds)
            in_round = because("program.step.in_round", round=rounds, **step)
            print(sentence(in_round if rounds else because("program.step", **step)), flush=True)

    return show


def _await(run: ProgramRun, quiet: bool) -> RunState:
    """To its end; the first Ctrl-C stops the arm and waits for its rest, the second one leaves."""
    try:
        return run.wait()
    except KeyboardInterrupt:
        if not quiet:
            print(sentence(because("program.stopping")), flush=True)
        run.stop()
        return run.wait(BRAKING)


def _end_text(state: RunState, joints: dict[str, float], robot: gemelo.Robot) -> str:
    if state.status is RunStatus.DONE:
        return sentence(because("program.done", program=state.program, count=state.done))
    where = ", ".join(f"{name} {value:.4f} {robot.description.joint(name).unit}" for name, value in joints.items())
    again = f"gemelo program run {shlex.quote(state.program)} --from {path_text(state.step)}"
    why, how = state.why or plain(state.message), {"program": state.program, "status": str(state.status)}
    return sentence(because("program.ended", why, at=where, again=again, **how))
