"""`gemelo blackbox`: the minutes that were saved at faults, emergency stops, aborts and crashes, and what happened."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import msgspec

from gemelo.libraries.recordings.incidents import (
    FOLDER,
    BlackBoxFile,
    Incident,
    black_boxes,
    in_language,
    is_saving,
    read_incident,
    time_of,
)
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import columns, language, sentence, word
from gemelo.tools.cli.common.session import load_robot
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser, json_option
from gemelo.tools.cli.recording.bag import one_sentence

SAVING = because("recording.black_box.saving")


def list_options(parser: Parser) -> None:
    """Adds --json."""
    json_option(parser)


def run_list(options: Options) -> ExitCode:
    """Prints the saved black boxes, the newest first."""
    folder, found, saving = _found()
    if options.json:
        print(msgspec.json.encode(found).decode())
    elif not found:
        print(sentence(saving or because("recording.black_box.none", folder=str(folder))))
    else:
        rows = [
            (str(number), time_of(each.incident.stamp), word("incident", each.incident.kind), _clause(each.incident))
            for number, each in enumerate(found, 1)
        ]
        print(f"{table(columns('N', 'when', 'what', 'sentence'), rows)}\n")
        print(sentence(because("recording.black_box.show")))
        if saving is not None:
            print(sentence(saving))
    return ExitCode.OK


def show_options(parser: Parser) -> None:
    """Adds which one, and --json."""
    _which_option(parser)
    json_option(parser)


def run_show(options: Options) -> ExitCode:
    """Prints what happened, and what led to it."""
    _, incident = _chosen(options.which)
    print(msgspec.json.encode(incident).decode() if options.json else story(incident))
    return ExitCode.OK


def open_options(parser: Parser) -> None:
    """Adds which one, --save and --picture."""
    _which_option(parser)
    parser.add_argument("--save", type=Path, metavar="FILE", help="write the view as an .rrd there, and open none")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="save a PNG of that moment, and open no view")


def run_open(options: Options) -> ExitCode:
    """Prints what happened, then becomes the view of that moment."""
    path, incident = _chosen(options.which)
    print(story(incident), flush=True)
    wanted = {"--save": options.save, "--picture": options.picture}
    said = [text for name, value in wanted.items() if value is not None for text in (name, str(value))]
    program = [sys.executable, "-m", "gemelo.services.visualizer.recorded"]
    command = [*program, str(path), "--lang", language(), *said]
    os.execv(sys.executable, command)


def story(incident: Incident) -> str:
    """The incident as text, in the language of this command line."""
    worded = in_language(incident, language())
    margins = [f"  {each}" for each in worded.margins]
    lines = [f"{each.at:+8.2f} s  {each.text}" for each in worded.story]
    return "\n".join([worded.sentence, *margins, *lines])


def _which_option(parser: Parser) -> None:
    said = "number of `gemelo blackbox list`, 1 is the newest; or a file"
    parser.add_argument("which", metavar="N", nargs="?", default="1", help=said)


def _chosen(which: str) -> tuple[Path, Incident]:
    if not which.isdecimal():
        with one_sentence():
            return Path(which), read_incident(Path(which))
    folder, found, saving = _found()
    if not found:
        raise CommandError(saving or because("recording.black_box.none", folder=str(folder)))
    if not 1 <= int(which) <= len(found):
        raise CommandError(because("recording.black_box.number", number=which, count=len(found)))
    chosen = found[int(which) - 1]
    return Path(chosen.path), chosen.incident


def _found() -> tuple[Path, list[BlackBoxFile], Reason | None]:
    """The folder, what is in it of the robot, and what to say where one is being saved; None where none is."""
    robot = load_robot()
    folder = project_root() / robot.deployment.paths.out / FOLDER
    name = robot.description.name
    saving = SAVING if is_saving(folder, name, time.time()) else None
    return folder, black_boxes(folder, name), saving


def _clause(incident: Incident) -> str:
    """What happened, without its time; an older file has the English sentence alone."""
    if incident.why is not None:
        return "; ".join(map(sentence, incident.why.causes))
    return incident.sentence.partition(" UTC: ")[2] or incident.sentence
