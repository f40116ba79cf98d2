"""Taught points and programs: files that a person can read, checked before they run, run under a person's hand."""

from __future__ import annotations

from gemelo.programs.check import CheckedLeg, ProgramCheck, check_program
from gemelo.programs.export import export_script
from gemelo.programs.folder import Programs, programs_folder
from gemelo.programs.meaning import find_mistakes, find_mistakes_in_file
from gemelo.programs.mistakes import Mistake, ProgramError
from gemelo.programs.points import Point, Points
from gemelo.programs.program import Program
from gemelo.programs.reading import read_program
from gemelo.programs.run import ProgramRun, RunState, RunStatus
from gemelo.programs.steps import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    MotionStep,
    Output,
    Pick,
    Play,
    Repeat,
    Speed,
    Step,
    StepPath,
    Wait,
    WaitFor,
    kind_of,
    parse_path,
    path_text,
    words_of,
)

__all__ = [
    "AnyStep",
    "Arc",
    "Attach",
    "Call",
    "CheckedLeg",
    "Detach",
    "Go",
    "Grip",
    "Line",
    "Mistake",
    "MotionStep",
    "Output",
    "Pick",
    "Play",
    "Point",
    "Points",
    "Program",
    "ProgramCheck",
    "ProgramError",
    "ProgramRun",
    "Programs",
    "Repeat",
    "RunState",
    "RunStatus",
    "Speed",
    "Step",
    "StepPath",
    "Wait",
    "WaitFor",
    "check_program",
    "export_script",
    "find_mistakes",
    "find_mistakes_in_file",
    "kind_of",
    "parse_path",
    "path_text",
    "programs_folder",
    "read_program",
    "words_of",
]
