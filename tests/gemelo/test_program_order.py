"""The order and the speed of a program's steps, and the script that does the same."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from hypothesis import given

from gemelo import BadArgument
from gemelo.programs import (
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    Output,
    Pick,
    Point,
    Program,
    Repeat,
    Speed,
    Wait,
    WaitFor,
    export_script,
)
from gemelo.programs.sequence import legs_of, lost_blend, single_legs
from gemelo.schemas.reasons import because
from tests.gemelo.test_package import mypy
from tests.gemelo.test_program_files import programs

A, B, C = (Go(state=name) for name in "abc")


def order(program: Program, called: dict[str, Program] | None = None, first: tuple[int, ...] = ()) -> list[object]:
    """(path, rounds, share) of every leg."""
    return [(leg.path, leg.rounds, leg.speed) for leg in legs_of(program, called or {}, first)]


def test_repeats_and_calls_are_carried_out_in_place() -> None:
    inner = Program("inner", (A, Repeat(count=2, steps=(B,))))
    program = Program("p", (Repeat(count=2, steps=(C, Call(program="inner"))), A))
    inside = [((0, 1, 0), 1.0), ((0, 1, 1, 0), 1.0), ((0, 1, 1, 0), 1.0)]
    assert [(path, speed) for path, _, speed in order(program, {"inner": inner})] == [
        ((0, 0), 1.0), *inside, ((0, 0), 1.0), *inside, ((1,), 1.0),
    ]  # fmt: skip
    assert [rounds for _, rounds, _ in order(program, {"inner": inner})][:4] == [(0,), (0,), (0, 0), (0, 1)]


def test_a_speed_holds_in_its_program_and_in_those_that_it_calls() -> None:
    inner = Program("inner", (A, Speed(share=0.1), B))
    program = Program(
        "p", (A, Speed(share=0.5), Call(program="inner"), Repeat(count=2, steps=(B, Speed(share=0.2))), C)
    )
    speeds = [speed for _, _, speed in order(program, {"inner": inner})]
    assert speeds == [1.0, 0.5, 0.1, 0.5, 0.2, 0.2]


def test_a_program_begins_at_any_step_with_the_speed_that_holds_there() -> None:
    inner = Program("inner", (A, B))
    steps = (Speed(share=0.5), A, Repeat(count=2, steps=(Speed(share=0.3), B, C)), Call(program="inner"))
    program = Program("p", steps)
    assert order(program, {"inner": inner}, (2, 2)) == [
        ((2, 2), (0,), 0.3), ((2, 1), (1,), 0.3), ((2, 2), (1,), 0.3), ((3, 0), (), 0.3), ((3, 1), (), 0.3),
    ]  # fmt: skip
    assert order(program, {"inner": inner}, (3, 1)) == [((3, 1), (), 0.3)]
    for path in ((9,), (2, 3), (1, 0), (3, 2)):
        with pytest.raises(BadArgument, match='program "p" has no step'):
            order(program, {"inner": inner}, path)


def test_a_million_rounds_are_not_unrolled_before_they_are_asked_for() -> None:
    program = Program("p", (Repeat(count=1_000_000, steps=(Repeat(count=1_000_000, steps=(A,)),)),))
    legs = single_legs(program, {})
    assert next(legs).rounds == (0, 0)
    assert next(legs).rounds == (0, 1)


def test_blended_motions_of_one_kind_and_speed_are_one_leg() -> None:
    soft = Go(state="a", blend=0.01)
    line = Line(position=(0.1, 0.2, 0.3), blend=0.02)
    program = Program("p", (soft, soft, B, soft, Wait(time=1.0), line, line, Line(offset=(0.0, 0.0, 0.1)), soft))
    legs = list(legs_of(program, {}))
    assert [leg.paths for leg in legs] == [((0,), (1,), (2,)), ((3,),), ((4,),), ((5,), (6,)), ((7,),), ((8,),)]
    assert set(lost_blend(tuple(legs))) == {(3,), (6,)}
    faster = Program("q", (soft, Speed(share=0.5), B))
    assert [leg.paths for leg in legs_of(faster, {})] == [((0,),), ((2,),)]


POINTS = {'it\'s "p" {x}\\': Point({"joint \u00f1": 0.1, "b": -2e-9}), "q": Point({"b": 1.0})}
ALL = Program(
    "all \u00f1",
    (
        Speed(share=0.07),
        Go(point='it\'s "p" {x}\\', blend=0.01),
        Go(position=(0.1, 0.2, 0.3), rpy=(0.0, 1.0, 0.0), blend=0.02),
        Go(state="it's"),
        Line(offset=(0.0, 0.0, 0.1), frame="tool", tool_speed=0.05),
        Output(name="gripper", on=True),
        Grip(to="close"),
        Grip(to=0.025),
        Pick(thing="cup", place="bin"),
        Pick(thing="it's", place="bin", camera="above"),
        Repeat(count=3, steps=(Wait(time=0.5), Go(joints={"b": 0.5}))),
        WaitFor(sensor="u", below=3.0, timeout=2.0),
        Attach(object="cup", touch=("l",)),
        Detach(object="cup"),
        Call(program="inner"),
    ),
    robot='r"m',
)


def test_a_script_is_type_complete_and_names_stay_texts(tmp_path: Path, root: Path) -> None:
    inner = Program("inner", (Go(point="q"),))
    script = export_script(ALL, POINTS, {"inner": inner})
    checked = mypy(tmp_path, script, root)
    assert (checked.returncode, checked.stdout) == (0, "")
    assert 'via=[POINTS["it\'s \\"p\\" {x}\\\\"], gemelo.Pose((0.1, 0.2, 0.3), ' in script
    assert 'raise SystemExit("this is for r\\"m, and the arm is " + arm.name)' in script
    assert 'arm.grip("close")' in script
    assert "arm.grip(0.025)" in script
    assert script.index("def run_inner(") < script.index("def run_all(")


@given(programs)
def test_every_program_becomes_a_script_that_compiles(program: Program) -> None:
    names = {step.point for _, step in program.all_steps() if isinstance(step, Go | Line) and step.point}
    calls = {step.program for _, step in program.all_steps() if isinstance(step, Call)}
    points = {name: Point({"a": 0.5}) for name in names}
    other = Program("inner", (Wait(time=1.0),))
    tree = ast.parse(export_script(program, points, dict.fromkeys(calls, other)))
    texts = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    assert names <= texts
    functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)} - {"wait_for"}
    assert len(functions) == 1 + len(calls)


def test_calls_in_a_circle_are_no_script() -> None:
    one, two = Program("one", (Call(program="two"),)), Program("two", (Call(program="one"),))
    with pytest.raises(BadArgument) as caught:
        export_script(one, {}, {"one": one, "two": two})
    assert caught.value.reason == because("program.calls.endless", programs=("one", "two", "one"))
