"""A program of five hundred steps is written, read, checked and run to its end; beyond the limit one is refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import gemelo
from gemelo.programs import (
    Go,
    Line,
    Points,
    Program,
    ProgramRun,
    Programs,
    RunState,
    RunStatus,
    Speed,
    check_program,
    find_mistakes_in_file,
)
from gemelo.programs.steps import AnyStep
from gemelo.programs.values import MOST_STEPS

STEPS = 500
MOVES = 4  # steps from one that moves to the next
LAST = "efector_joint"


def step(index: int, arm: gemelo.Arm) -> AnyStep:
    """Every fourth a motion, every twentieth a line of the tool."""
    if index % MOVES:
        return Speed(share=0.9 + 0.01 * (index % 10))
    if index % 20 == 8:
        return Line(offset=(0.0, 0.0, 0.002 if index % 40 == 8 else -0.002))
    return Go(joints={LAST: arm.states["ready"][LAST] + 0.05 * math.sin(index)})


@pytest.fixture
def program(arm: gemelo.Arm) -> Program:
    arm.move(named="ready")
    return Program("long", tuple(step(index, arm) for index in range(STEPS)))


def test_a_program_of_500_steps_is_written_read_and_checked(arm: gemelo.Arm, program: Program, tmp_path: Path) -> None:
    program.save(tmp_path)
    programs, points = Programs(tmp_path), Points.load(tmp_path, arm.description)
    assert programs["long"].steps == program.steps
    checked = check_program(arm, programs["long"], points, programs)
    assert checked.mistakes == ()
    assert [leg.refusal for leg in checked.legs] == [None] * len(checked.legs)
    assert {path for leg in checked.legs for path in leg.paths} >= {(index,) for index in range(0, STEPS, MOVES)}


@pytest.mark.full
def test_a_program_of_500_steps_runs_to_its_end(arm: gemelo.Arm, program: Program, tmp_path: Path) -> None:
    states: list[RunState] = []
    points = Points.load(tmp_path, arm.description)
    run = ProgramRun(arm, program, points, Programs(tmp_path), on_change=states.append)
    run.start()
    ended = run.wait(10.0 * STEPS)
    assert (ended.status, ended.message, ended.done) == (RunStatus.DONE, "", STEPS // MOVES)
    assert {path for state in states for path in state.steps} >= {(index,) for index in range(0, STEPS, MOVES)}


def test_a_program_of_more_steps_than_the_limit_is_refused_with_number_and_remedy(
    arm: gemelo.Arm, tmp_path: Path
) -> None:
    file = Program("long", (Speed(share=1.0),) * (MOST_STEPS + 1)).save(tmp_path)
    said = [str(each) for each in find_mistakes_in_file(file, arm.description, {}, {})]
    assert len(said) == 1
    assert f"a program has at most {MOST_STEPS} steps: make several, and call them" in said[0]
