"""Files of programs: written and read back, and everything that can be wrong in one told with line and remedy."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo import BadArgument, Error
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.toml_lines import toml_lines
from gemelo.programs import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    Output,
    Pick,
    Point,
    Points,
    Program,
    ProgramError,
    Programs,
    Repeat,
    Speed,
    Wait,
    WaitFor,
    find_mistakes,
    find_mistakes_in_file,
    parse_path,
    path_text,
    read_program,
    words_of,
)
from gemelo.programs.reading import parse_program
from gemelo.programs.steps import KINDS
from tests.table import table

ROBOT = load_arm(Path(__file__).parents[2] / "urdf" / "rm1")
POINTS = {"above the box": Point({"brazo_joint": 0.1, "antebrazo_joint": 0.2, "efector_joint": 0.05})}

texts = st.text(st.characters(exclude_categories=["C"]), min_size=1, max_size=12)
lengths = st.floats(-9.0, 9.0)
vectors = st.tuples(lengths, lengths, lengths)
shares = st.one_of(st.floats(1e-6, 1.0), st.integers(1, 100).map(lambda percent: percent / 100.0))
goals = st.one_of(
    st.fixed_dictionaries({"point": texts}),
    st.fixed_dictionaries({"state": texts}),
    st.fixed_dictionaries({"joints": st.dictionaries(texts, st.floats(-3.0, 3.0), min_size=1, max_size=3)}),
    st.fixed_dictionaries({"position": vectors}, optional={"rpy": st.tuples(*[st.floats(-6.0, 6.0)] * 3)}),
    st.fixed_dictionaries({"offset": vectors}, optional={"frame": texts}),
)
blends = st.sampled_from([0.0, 0.01, 0.2])
single: st.SearchStrategy[AnyStep] = st.one_of(
    st.builds(lambda goal, blend: Go(**goal, blend=blend), goals, blends),
    st.builds(lambda goal, speed: Line(**goal, tool_speed=speed), goals, st.floats(0.0, 5.0)),
    st.builds(lambda to, through: Arc(position=to, through=through), vectors, vectors),
    st.builds(Output, name=texts, on=st.booleans()),
    st.builds(Grip, to=st.one_of(st.sampled_from(["open", "close"]), st.floats(0.0, 0.05))),
    st.builds(Pick, thing=texts, place=texts, camera=texts),
    st.builds(Wait, time=st.floats(0.0, 100.0)),
    st.builds(WaitFor, sensor=texts, above=lengths, timeout=st.floats(0.0, 10.0)),
    st.builds(WaitFor, sensor=texts, below=lengths),
    st.builds(Speed, share=shares),
    st.builds(Attach, object=texts, link=texts, touch=st.lists(texts, max_size=2).map(tuple)),
    st.builds(Detach, object=texts),
    st.builds(Call, program=texts),
)
steps = st.recursive(
    single,
    lambda inner: st.builds(Repeat, count=st.integers(1, 9), steps=st.lists(inner, min_size=1, max_size=3).map(tuple)),
    max_leaves=6,
)
programs = st.builds(
    Program, st.just("under test here"), st.lists(steps, max_size=5).map(tuple), st.sampled_from(["", "rm1"])
)


@given(programs)
def test_what_is_written_reads_back_as_the_same(program: Program) -> None:
    again, mistakes = parse_program(program.name, program.to_toml())
    assert (again, mistakes) == (program, [])


def places(value: Any, here: tuple[str | int, ...] = ()) -> set[tuple[str | int, ...]]:
    """Every key and element of what a TOML text says."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return {here, *(place for key, each in inner for place in places(each, (*here, key)))}


@given(programs, st.lists(texts, max_size=3))
def test_every_place_of_a_file_has_its_line(program: Program, comments: list[str]) -> None:
    text = "".join(f"# {each}\n" for each in comments) + program.to_toml()
    lines = toml_lines(text)
    assert {(), *lines} == places(tomllib.loads(text))
    rows = text.splitlines()
    for place, line in lines.items():
        if place[-1] == "do":
            assert 'do = "' in rows[line - 1]


def test_lines_are_found_in_every_way_of_writing_toml() -> None:
    text = (
        'a = 1 # "x\n[b.c]\nd = """\n[no]\n""\\"""""\n"e \\" f".g = [1, # ]\n 2,\n]\r\nk = {l = {m = [{}, {n=1}]}}\n'
        "[[h]]\ni = '''\n'''''\n[[h]]\n[[h.j]]\ni = -1e3\n[h.j.q]\nz = 1979-05-27T07:32:00Z\n"
    )
    lines = toml_lines(text)
    assert {(), *lines} == places(tomllib.loads(text))
    assert lines["b", "c", "d"] == 3
    assert (lines["b", "c", 'e " f', "g"], lines["b", "c", 'e " f', "g", 1]) == (6, 7)
    assert lines["b", "c", "k", "l", "m", 1, "n"] == 9
    assert (lines["h", 0, "i"], lines["h", 1, "j", 0, "i"], lines["h", 1, "j", 0, "q", "z"]) == (11, 15, 17)


HEAD = "version = 1\n"
ONE = 'version = 1\nsteps = [\n  {do = "go", state = "ready"},\n  %s,\n]\n'
MISTAKES = [
    ("version = 2\n", 1, "version = 2: this gemelo reads version = 1"),
    ("steps = []\n", 0, "no version is given"),
    ("version = true\n", 1, "version = True"),
    (HEAD + "steps = [\n", 2, "this is not TOML: "),
    (HEAD + "steps = [{do = }]\n", 2, "this is not TOML: Invalid value (column 16)"),
    (HEAD + "steps = " + "[" * 5000 + "]" * 5000, 0, "nested far too deep"),
    (HEAD + "stesp = []\n", 2, 'unknown key "stesp"; did you mean "steps"?'),
    (HEAD + "steps = 3\n", 2, "steps = 3 is no list of steps"),
    (HEAD + "robot = 3\n", 2, "robot = 3 is not a text in quotes"),
    (HEAD + 'robot = "rm2"\n', 2, 'it is for robot "rm2", and this one is "rm1"'),
    (ONE % "7", 4, "7 is no step"),
    (ONE % '{state = "ready"}', 4, "a step says what it does: do = one of go, line, arc"),
    (ONE % '{do = "goo", state = "ready"}', 4, 'there is no step "goo"; did you mean "go"?'),
    (ONE % "{do = 3}", 4, "do = 3 is not one of"),
    (ONE % '{do = "go", stat = "ready"}', 4, 'go has no key "stat"; did you mean "state"?'),
    (ONE % '{do = "go"}', 4, "a motion goes to one of point, state, joints, position, offset: none is given"),
    (ONE % '{do = "go", state = "ready", point = "x"}', 4, "not point and state at once"),
    (ONE % '{do = "go", state = "redy"}', 4, 'rm1 has no named state "redy"; did you mean "ready"?'),
    (ONE % '{do = "go", point = "above box"}', 4, 'no point "above box" of rm1; did you mean "above the box"?'),
    (ONE % '{do = "go", point = "a\\u0000b"}', 4, 'no point "a\0b" of rm1'),
    (ONE % '{do = "go", joints = {brazo = 1}}', 4, 'rm1 has no joint "brazo"; did you mean "brazo_joint"?'),
    (ONE % '{do = "go", joints = {brazo_joint = 30}}', 4, 'if it is in degrees, write "30deg"'),
    (
        ONE % '{do = "go", joints = {brazo_joint = "200deg"}}',
        4,
        "= 3.49066 rad is beyond its limits, -2.95 to 2.95 rad",
    ),
    (ONE % '{do = "go", joints = {brazo_joint = nan}}', 4, 'joint "brazo_joint" is nan: it must be finite'),
    (ONE % '{do = "go", joints = [1, 2, 3]}', 4, "joints = [1, 2, 3] is not numbers by joint"),
    (ONE % '{do = "go", position = [300, 0, 100]}', 4, 'position has 300 m: if it is in millimetres, write "300mm"'),
    (ONE % '{do = "go", position = [0.3, 0.1]}', 4, "position = [0.3, 0.1] is not three numbers"),
    (ONE % '{do = "go", position = [0.3, inf, 0.1]}', 4, "position[1] is inf: it must be finite"),
    (ONE % '{do = "go", position = [0.3, "5kg", 0.1]}', 4, "'5kg' has none of the units m, cm, mm"),
    (ONE % '{do = "go", position = [0.3, 0, 0.1], orientation = [0, 0, 0, 2]}', 4, "a quaternion of length 2.0000"),
    (ONE % '{do = "go", position = [0.3, 0, 0.1], rpy = [90, 0, 0]}', 4, 'write "90deg"'),
    (ONE % '{do = "go", state = "ready", rpy = [0, 0, 0]}', 4, "give position too"),
    (ONE % '{do = "go", state = "ready", blend = 20}', 4, 'blend = 20 m is not 0 to 1 m: if it is in mm, write "20mm"'),
    (ONE % '{do = "go", state = "ready", blend = true}', 4, "blend = True is not a number, in m or with its unit"),
    (ONE % '{do = "line", offset = [0, 0, 0.1], frame = "efector"}', 4, 'did you mean "efector_link"?'),
    (ONE % '{do = "line", state = "ready", tool_speed = 50}', 4, 'if it is in mm, write "50mm/s"'),
    (ONE % '{do = "arc", position = [0.3, 0, 0.1]}', 4, "an arc goes by one of through and center"),
    (ONE % '{do = "arc", state = "ready", through = [0, 0.2, 0]}', 4, "an arc is the tool's"),
    (ONE % '{do = "output", name = "avanza", on = true}', 4, 'rm1 has no output "avanza"; did you mean "avanzar"?'),
    (ONE % '{do = "output", name = "avanzar"}', 4, 'output needs "on": true or false'),
    (ONE % '{do = "output", name = "avanzar", on = "yes"}', 4, "on = 'yes' is not true or false"),
    (ONE % '{do = "grip", to = "shut"}', 4, 'to = \'shut\' is not "open", "close" or a length'),
    (ONE % '{do = "grip", to = "90mm"}', 4, "grip(0.09) is not 0 to 0.05 m between the jaws"),
    (ONE % '{do = "grip", to = 25}', 4, "25 mm is 0.025"),
    (ONE % '{do = "grip", to = nan}', 4, "finite"),
    (ONE % '{do = "grip"}', 4, 'grip needs "to"'),
    (ONE % '{do = "wait", time = nan}', 4, "time is nan: it must be finite"),
    (ONE % '{do = "wait", time = -1}', 4, "time = -1 s is not 0 to 86400 s"),
    (ONE % '{do = "wait", time = 1e300}', 4, "time = 1e+300 s is not 0 to 86400 s"),
    (ONE % '{do = "wait_for", sensor = "ultr", above = 3}', 4, 'rm1 has no sensor "ultr"; did you mean "ultra"?'),
    (ONE % '{do = "wait_for", sensor = "ultra"}', 4, "one of above and below"),
    (
        ONE % '{do = "speed", share = 50}',
        4,
        'share = 50 is not a share in per cent, as "50%": write it in per cent: "50%"',
    ),
    (ONE % '{do = "speed", share = "0%"}', 4, "share = 0% is not above 0%"),
    (ONE % '{do = "speed", share = "150%"}', 4, "share = 150% is not above 0% and at most 100%"),
    (ONE % '{do = "attach", object = "cup", link = "hand"}', 4, 'rm1 has no link "hand"'),
    (ONE % '{do = "repeat", count = 0, steps = [{do = "wait", time = 1}]}', 4, "count = 0 is not 1 to"),
    (ONE % '{do = "repeat", count = 2.5, steps = []}', 4, "count = 2.5 is not a whole number"),
    (ONE % '{do = "repeat", count = 2, steps = []}', 4, "a repeat needs steps"),
    (ONE % ('{do = "repeat", count = 2, steps = [' * 12 + "]}" * 12), 4, "repeats are nested more than 8 deep"),
    (ONE % '{do = "call", program = "nobody"}', 4, 'no program "nobody"'),
    (ONE % '{do = "call", program = "../x"}', 4, "has / in it: it becomes the name of a file"),
    (ONE % '{do = "call", program = "a\\u0000"}', 4, "has the control character '\\x00' in it"),
    (ONE % '{do = "call", program = "me"}', 4, 'this would never end: "me" calls "me"'),
    (HEAD + "steps = [" + '{do = "wait", time = 1},' * 2001 + "]", 2, "a program has at most 2000 steps"),
]


@table(("text", "line", "said"), MISTAKES, ids=[said[:50] for _, _, said in MISTAKES])
def test_a_mistake_is_told_with_file_line_and_remedy(text: str, line: int, said: str, tmp_path: Path) -> None:
    file = tmp_path / "me.toml"
    file.write_text(text)
    found = find_mistakes_in_file(file, ROBOT, POINTS, Programs(tmp_path))
    told = [mistake for mistake in found if said in mistake.what]
    assert told, found
    assert told[0].line == line
    assert str(told[0]).startswith(f"{file}, line {line}: " if line else f"{file}: ")


def test_all_mistakes_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    wrong = [(text, said) for text, line, said in MISTAKES if line == 4]
    rows = [text.splitlines()[3] for text, _ in wrong]
    file = tmp_path / "me.toml"
    file.write_text(HEAD + "steps = [\n" + "\n".join(rows) + "\n]\n")
    found = find_mistakes_in_file(file, ROBOT, POINTS, Programs(tmp_path))
    for row, (_, said) in enumerate(wrong, start=3):
        assert any(mistake.line == row and said in mistake.what for mistake in found), (row, said)
    assert [mistake.line for mistake in found] == sorted(mistake.line for mistake in found)


def test_calls_in_a_circle_are_refused_by_name(tmp_path: Path) -> None:
    for name, called in (("one", "two"), ("two", "three"), ("three", "two")):
        Program(name, (Call(program=called),)).save(tmp_path)
    programs = Programs(tmp_path)
    [mistake] = find_mistakes(programs["one"], ROBOT, POINTS, programs)
    assert str(mistake).startswith(f"{tmp_path / 'three.toml'}, line 4: step 1: ")
    assert '"two" calls "three" calls "two"' in mistake.what


def test_calls_that_are_too_deep_are_refused(tmp_path: Path) -> None:
    for number in range(12):
        Program(f"p{number}", (Call(program=f"p{number + 1}"),)).save(tmp_path)
    programs = Programs(tmp_path)
    [mistake] = find_mistakes(programs["p0"], ROBOT, POINTS, programs)
    assert "calls are more than 8 deep: p0, p1" in mistake.what


def test_the_mistakes_of_a_called_program_are_told_with_its_own_file(tmp_path: Path) -> None:
    (tmp_path / "inner.toml").write_text("version = 1\nsteps = [{do = 'nothing'}]\n")
    programs = Programs(tmp_path)
    [mistake] = find_mistakes(Program("outer", (Call(program="inner"),)), ROBOT, POINTS, programs)
    assert str(mistake).startswith(f"{tmp_path / 'inner.toml'}, line 2: step 1: there is no step")


def test_numbers_may_have_units_in_a_file() -> None:
    program, mistakes = parse_program("p", ONE % '{do = "go", joints = {a = "90deg", b = "40mm"}, blend = "2 cm"}')
    assert not mistakes
    assert program.steps[1] == Go(joints={"a": pytest.approx(1.5707963), "b": 0.04}, blend=0.02)


@table("name", ["", " ", "a/b", "a\\b", "..", ".x", "x\0", "x\n", "x" * 65, "rm1.points", 'a"b'])
def test_what_can_be_no_name_of_a_file_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(BadArgument):
        Program(name, ())
    assert name not in Programs(tmp_path)


def test_the_folder_is_read_as_it_is_now(tmp_path: Path) -> None:
    programs = Programs(tmp_path / "not there yet")
    assert list(programs) == []
    Program("b", (Go(state="ready"),)).save(programs.folder)
    Program("a ñ", (Go(state="left"),)).save(programs.folder)
    (programs.folder / "rm1.points.toml").write_text("version = 1\n")
    assert list(programs) == ["a ñ", "b"]
    programs.rename("b", "c")
    programs.remove("a ñ")
    assert list(programs) == ["c"]
    assert programs["c"].steps == (Go(state="ready"),)
    with pytest.raises(BadArgument, match='no program "d"'):
        programs.require("d")
    with pytest.raises(KeyError):
        programs["d"]


def test_files_whose_names_or_contents_are_no_programs_leave_the_others_as_they_are(tmp_path: Path) -> None:
    Program("a", (Go(state="ready"),)).save(tmp_path)
    (tmp_path / "b?.toml").touch()
    (tmp_path / ".c.toml").touch()
    (tmp_path / "d.toml").mkdir()
    (tmp_path / "e.toml").write_bytes(b"\xff")
    programs = Programs(tmp_path)
    assert list(programs) == ["a", "e"]
    [mistake] = find_mistakes_in_file(programs.file("e"), ROBOT, POINTS, programs)
    assert str(mistake).startswith(f"{tmp_path / 'e.toml'}: is no UTF-8 text")


def test_a_folder_that_can_be_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadArgument, match="no path has a NUL in it"):
        Programs("a\0b")
    (tmp_path / "file").touch()
    with pytest.raises(BadArgument, match="is a file"):
        Programs(tmp_path / "file")


def test_a_file_that_is_no_text_or_far_too_large_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(Error, match="is no UTF-8 text"):
        read_program(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(Error, match="1000001 bytes"):
        read_program(tmp_path / "b.toml")


def test_a_file_that_is_saved_again_keeps_its_place(tmp_path: Path) -> None:
    path = Program("p", (Wait(time=1.0),)).save(tmp_path)
    assert read_program(path).save() == path
    with pytest.raises(BadArgument, match="read from no file"):
        Program("q", ()).save()
    with pytest.raises(ProgramError):
        read_program((tmp_path / "w.toml").parent / _written(tmp_path, "w.toml", "steps = 3"))


def _written(folder: Path, name: str, text: str) -> str:
    (folder / name).write_text(text)
    return name


@given(st.lists(st.integers(0, 300), min_size=1, max_size=6).map(tuple))
def test_a_steps_number_reads_back(path: tuple[int, ...]) -> None:
    assert parse_path(path_text(path)) == path


@table("text", ["", "0", "1.0", "a", "1.", "-1", "1..2", "1e3", "9" * 9])
def test_what_is_no_step_is_refused(text: str) -> None:
    with pytest.raises(BadArgument, match="is no step"):
        parse_path(text)


def test_the_files_of_the_page_about_programs_are_right(root: Path, tmp_path: Path) -> None:
    program, points = re.findall(r"```toml\n(.*?)```", (root / "docs/programs.md").read_text(), flags=re.DOTALL)
    (tmp_path / "shown.toml").write_text(program)
    (tmp_path / "rm1.points.toml").write_text(points)
    (tmp_path / "tour.toml").write_text((root / "programs/tour.toml").read_text())
    programs = Programs(tmp_path)
    assert find_mistakes_in_file(tmp_path / "shown.toml", ROBOT, Points.load(tmp_path, ROBOT), programs) == ()
    assert {type(step) for _, step in programs["shown"].all_steps()} == set(KINDS)


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_the_programs_of_the_project_have_no_mistakes_on_any_arm(root: Path, robot: str) -> None:
    programs = Programs(root / "programs")
    assert "tour" in programs
    for name in programs:
        assert find_mistakes_in_file(programs.file(name), load_arm(root / "urdf" / robot), {}, programs) == ()


def test_a_line_about_a_step_tells_what_it_was_given_and_nothing_that_is_usual() -> None:
    assert words_of(Go(point="P", blend=0.0 / 1000.0)) == "go point='P'"
    assert words_of(Go(point="P", blend=0.01)) == "go point='P' blend=0.01"
