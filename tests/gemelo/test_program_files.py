"""Files of programs: written and read back, and everything that can be wrong in one told with line and remedy."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo import BadArgument
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
from gemelo.programs.mistakes import Mistake
from gemelo.programs.reading import A_STEP, BY_KIND, parse_program
from gemelo.programs.steps import GOALS, KINDS
from gemelo.schemas.reasons import FrontEnd, Reason, Remedy, because, remedy, say
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


def near(name: str) -> Remedy:
    return remedy("did_you_mean", name=name)


def known(*names: str) -> Remedy:
    return remedy("known_are", names=names)


HEAD = "version = 1\n"
ONE = 'version = 1\nsteps = [\n  {do = "go", state = "ready"},\n  %s,\n]\n'
MISTAKES: list[tuple[str, int, Reason | str]] = [  # by its reason; by words of the API where it has no code
    ("version = 2\n", 1, because("file.version.other", value="2", known=1)),
    ("steps = []\n", 0, because("file.version.none", known=1)),
    ("version = true\n", 1, because("file.version.other", value="True", known=1)),
    (HEAD + "steps = [\n", 2, because("file.toml.end", problem="Invalid value")),
    (HEAD + "steps = [{do = }]\n", 2, because("file.toml.syntax", problem="Invalid value", column=16)),
    (HEAD + "steps = " + "[" * 5000 + "]" * 5000, 0, because("file.toml.nested")),
    (HEAD + "stesp = []\n", 2, because("file.key.unknown", near("steps"), key="stesp")),
    (HEAD + "steps = 3\n", 2, because("program.steps.kind", value="3", example='[{do = "go", state = "ready"}]')),
    (HEAD + "robot = 3\n", 2, because("program.value.kind", key="robot", value="3", expected="expected.text")),
    (HEAD + 'robot = "rm2"\n', 2, because("program.robot.other", robot="rm2", present="rm1")),
    (ONE % "7", 4, because("program.step.kind", value="7", example=A_STEP)),
    (ONE % '{state = "ready"}', 4, because("program.step.no_kind", known=tuple(BY_KIND))),
    (ONE % '{do = "goo", state = "ready"}', 4, because("program.step.unknown", near("go"), step="goo")),
    (ONE % "{do = 3}", 4, because("program.step.kind_of_kind", value="3", known=tuple(BY_KIND))),
    (ONE % '{do = "go", stat = "ready"}', 4, because("program.step.key", near("state"), step="go", key="stat")),
    (ONE % '{do = "go"}', 4, because("program.goal.none", known=GOALS)),
    (
        ONE % '{do = "go", state = "ready", point = "x"}',
        4,
        because("program.goal.several", known=GOALS, given=("point", "state")),
    ),
    (ONE % '{do = "go", state = "redy"}', 4, because("program.state.unknown", near("ready"), robot="rm1", name="redy")),
    (
        ONE % '{do = "go", point = "above box"}',
        4,
        because("point.unknown", near("above the box"), point="above box", robot="rm1"),
    ),
    (
        ONE % '{do = "go", point = "a\\u0000b"}',
        4,
        because("point.unknown", known("above the box"), point="a\x00b", robot="rm1"),
    ),
    (ONE % '{do = "go", joints = {brazo = 1}}', 4, 'rm1 has no joint "brazo"; did you mean "brazo_joint"?'),
    (
        ONE % '{do = "go", joints = {brazo_joint = 30}}',
        4,
        because(
            "argument.joint.other_unit",
            remedy("in_degrees", value=30.0),
            joint="brazo_joint",
            value=30.0,
            unit="rad",
            lower=-2.95,
            upper=2.95,
        ),
    ),
    (
        ONE % '{do = "go", joints = {brazo_joint = "200deg"}}',
        4,
        because(
            "program.joint.limits", joint="brazo_joint", value=3.490658503988659, lower=-2.95, upper=2.95, unit="rad"
        ),
    ),
    (
        ONE % '{do = "go", joints = {brazo_joint = nan}}',
        4,
        because("program.joint.not_finite", joint="brazo_joint", value="nan"),
    ),
    (
        ONE % '{do = "go", joints = [1, 2, 3]}',
        4,
        because(
            "program.value.kind_and_unit",
            key="joints",
            value="[1, 2, 3]",
            expected="expected.by_joint",
            unit="rad or m",
        ),
    ),
    (
        ONE % '{do = "go", position = [300, 0, 100]}',
        4,
        because("argument.point.far", remedy("in_millimetres", value=300.0), argument="position", value=300.0),
    ),
    (
        ONE % '{do = "go", position = [0.3, 0.1]}',
        4,
        because("program.value.kind_and_unit", key="position", value="[0.3, 0.1]", expected="expected.three", unit="m"),
    ),
    (ONE % '{do = "go", position = [0.3, inf, 0.1]}', 4, "position[1] is inf: it must be finite"),
    (
        ONE % '{do = "go", position = [0.3, "5kg", 0.1]}',
        4,
        because(
            "program.value.no_unit",
            because("program.value.unit", value="'5kg'", known=("m", "cm", "mm")),
            key="position",
            value="[0.3, '5kg', 0.1]",
            expected="expected.three",
            unit="m",
        ),
    ),
    (ONE % '{do = "go", position = [0.3, 0, 0.1], orientation = [0, 0, 0, 2]}', 4, "a quaternion of length 2.0000"),
    (
        ONE % '{do = "go", position = [0.3, 0, 0.1], rpy = [90, 0, 0]}',
        4,
        because("argument.turn.large", remedy("in_degrees", value=90.0), argument="rpy", value=90.0),
    ),
    (ONE % '{do = "go", state = "ready", rpy = [0, 0, 0]}', 4, because("program.turn.position", key="rpy")),
    (
        ONE % '{do = "go", state = "ready", blend = 20}',
        4,
        because(
            "program.value.range",
            remedy("write_millimetres", text="20mm"),
            key="blend",
            value=20.0,
            least=0.0,
            most=1.0,
            unit="m",
        ),
    ),
    (
        ONE % '{do = "go", state = "ready", blend = true}',
        4,
        because("program.value.kind_and_unit", key="blend", value="True", expected="expected.number", unit="m"),
    ),
    (
        ONE % '{do = "line", offset = [0, 0, 0.1], frame = "efector"}',
        4,
        because("program.link.unknown", near("efector_link"), robot="rm1", name="efector"),
    ),
    (
        ONE % '{do = "line", state = "ready", tool_speed = 50}',
        4,
        because(
            "program.value.range",
            remedy("write_millimetres", text="50mm/s"),
            key="tool_speed",
            value=50.0,
            least=0.0,
            most=5.0,
            unit="m/s",
        ),
    ),
    (ONE % '{do = "arc", position = [0.3, 0, 0.1]}', 4, because("program.arc.by")),
    (ONE % '{do = "arc", state = "ready", through = [0, 0.2, 0]}', 4, because("program.arc.goal")),
    (
        ONE % '{do = "output", name = "avanza", on = true}',
        4,
        because("program.output.unknown", near("avanzar"), robot="rm1", name="avanza"),
    ),
    (
        ONE % '{do = "output", name = "avanzar"}',
        4,
        because("program.step.needs", step="output", key="on", expected="expected.boolean"),
    ),
    (
        ONE % '{do = "output", name = "avanzar", on = "yes"}',
        4,
        because("program.value.kind", key="on", value="'yes'", expected="expected.boolean"),
    ),
    (
        ONE % '{do = "grip", to = "shut"}',
        4,
        because(
            "program.value.no_unit",
            because("program.value.unit", value="'shut'", known=("m", "cm", "mm")),
            key="to",
            value="'shut'",
            expected="expected.opening",
            unit="m",
        ),
    ),
    (ONE % '{do = "grip", to = "90mm"}', 4, because("argument.grip.range", value=0.09, least=0.0, most=0.05)),
    (ONE % '{do = "grip", to = 25}', 4, "25 mm is 0.025"),
    (ONE % '{do = "grip", to = nan}', 4, "finite"),
    (
        ONE % '{do = "grip"}',
        4,
        because("program.step.needs_with_unit", step="grip", key="to", expected="expected.opening", unit="m"),
    ),
    (ONE % '{do = "wait", time = nan}', 4, because("program.value.not_finite", key="time", value="nan")),
    (
        ONE % '{do = "wait", time = -1}',
        4,
        because("program.value.range", key="time", value=-1.0, least=0.0, most=86400.0, unit="s"),
    ),
    (
        ONE % '{do = "wait", time = 1e300}',
        4,
        because("program.value.range", key="time", value=1e300, least=0.0, most=86400.0, unit="s"),
    ),
    (
        ONE % '{do = "wait_for", sensor = "ultr", above = 3}',
        4,
        because("program.sensor.unknown", near("ultra"), robot="rm1", name="ultr"),
    ),
    (ONE % '{do = "wait_for", sensor = "ultra"}', 4, because("program.wait_for.bound")),
    (
        ONE % '{do = "speed", share = 50}',
        4,
        because(
            "program.value.no_share",
            because("program.value.percent", text="50%"),
            key="share",
            value="50",
            expected="expected.share",
        ),
    ),
    (ONE % '{do = "speed", share = "0%"}', 4, because("program.speed.share", value=0.0)),
    (ONE % '{do = "speed", share = "150%"}', 4, because("program.speed.share", value=1.5)),
    (
        ONE % '{do = "attach", object = "cup", link = "hand"}',
        4,
        because(
            "program.link.unknown",
            known("antebrazo_link", "base_link", "brazo_link", "efector_link"),
            robot="rm1",
            name="hand",
        ),
    ),
    (
        ONE % '{do = "repeat", count = 0, steps = [{do = "wait", time = 1}]}',
        4,
        because("program.repeat.count", value=0, limit=1000000),
    ),
    (
        ONE % '{do = "repeat", count = 2.5, steps = []}',
        4,
        because("program.value.kind", key="count", value="2.5", expected="expected.integer"),
    ),
    (ONE % '{do = "repeat", count = 2, steps = []}', 4, because("program.repeat.empty")),
    (ONE % ('{do = "repeat", count = 2, steps = [' * 12 + "]}" * 12), 4, because("program.repeat.nested", limit=8)),
    (ONE % '{do = "call", program = "nobody"}', 4, because("program.unknown", known("me"), program="nobody")),
    (ONE % '{do = "call", program = "../x"}', 4, because("program.name.characters", name="../x", characters="/")),
    (
        ONE % '{do = "call", program = "a\\u0000"}',
        4,
        because("program.name.control", kind="program", name="a\x00", character="\x00"),
    ),
    (ONE % '{do = "call", program = "me"}', 4, because("program.calls.endless", programs=("me", "me"))),
    (HEAD + "steps = [" + '{do = "wait", time = 1},' * 2001 + "]", 2, because("program.steps.many", limit=2000)),
]


def is_for(mistake: Mistake, why: Reason | str) -> bool:
    return mistake.what == why if isinstance(why, Reason) else why in str(mistake.what)


@table(("text", "line", "why"), MISTAKES, ids=[str(why)[:50] for _, _, why in MISTAKES])
def test_a_mistake_is_reported_with_file_line_and_reason(
    text: str, line: int, why: Reason | str, tmp_path: Path
) -> None:
    file = tmp_path / "me.toml"
    file.write_text(text)
    found = find_mistakes_in_file(file, ROBOT, POINTS, Programs(tmp_path))
    told = [mistake for mistake in found if is_for(mistake, why)]
    assert told, found
    assert told[0].line == line
    assert str(told[0]).startswith(f"{file}, line {line}: " if line else f"{file}: ")


def test_a_mistake_is_a_sentence_in_each_language_with_the_names_as_the_file_has_them(tmp_path: Path) -> None:
    file = tmp_path / "me.toml"
    file.write_text(ONE % '{do = "go", joints = {brazo_joint = "200deg"}}')
    [mistake] = find_mistakes_in_file(file, ROBOT, POINTS, Programs(tmp_path))
    assert str(mistake) == (
        f'{file}, line 4: step 2: joint "brazo_joint" = 3.4907 rad is beyond its limits, -2.9500 rad to 2.9500 rad'
    )
    assert say(mistake.reason, "es", FrontEnd.PAGE) == (
        f"{file}, línea 4, paso 2: brazo_joint = 200.0° está más allá de sus límites, -169.0° a 169.0°"
    )


def test_all_mistakes_of_a_file_are_told_at_once(tmp_path: Path) -> None:
    wrong = [(text, why) for text, line, why in MISTAKES if line == 4]
    rows = [text.splitlines()[3] for text, _ in wrong]
    file = tmp_path / "me.toml"
    file.write_text(HEAD + "steps = [\n" + "\n".join(rows) + "\n]\n")
    found = find_mistakes_in_file(file, ROBOT, POINTS, Programs(tmp_path))
    for row, (_, why) in enumerate(wrong, start=3):
        assert any(mistake.line == row and is_for(mistake, why) for mistake in found), (row, why)
    assert [mistake.line for mistake in found] == sorted(mistake.line for mistake in found)


def test_calls_in_a_circle_are_refused_by_name(tmp_path: Path) -> None:
    for name, called in (("one", "two"), ("two", "three"), ("three", "two")):
        Program(name, (Call(program=called),)).save(tmp_path)
    programs = Programs(tmp_path)
    [mistake] = find_mistakes(programs["one"], ROBOT, POINTS, programs)
    assert str(mistake).startswith(f"{tmp_path / 'three.toml'}, line 4: step 1: ")
    assert mistake.what == because("program.calls.endless", programs=("two", "three", "two"))


def test_calls_that_are_too_deep_are_refused(tmp_path: Path) -> None:
    for number in range(12):
        Program(f"p{number}", (Call(program=f"p{number + 1}"),)).save(tmp_path)
    programs = Programs(tmp_path)
    [mistake] = find_mistakes(programs["p0"], ROBOT, POINTS, programs)
    assert mistake.what == because("program.calls.nested", programs=tuple(f"p{number}" for number in range(9)), limit=8)


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
    assert mistake.what.code == "file.encoding.byte"


def test_a_folder_that_can_be_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadArgument, match="no path has a NUL in it"):
        Programs("a\0b")
    (tmp_path / "file").touch()
    with pytest.raises(BadArgument, match="is a file"):
        Programs(tmp_path / "file")


def test_a_file_that_is_no_text_or_far_too_large_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ProgramError) as caught:
        read_program(tmp_path / "a.toml")
    assert caught.value.mistakes[0].what == because("file.encoding.other", remedy("save_as_utf8"), encoding="UTF-16")
    (tmp_path / "b.toml").write_bytes(b"#" * 1_000_001)
    with pytest.raises(ProgramError) as caught:
        read_program(tmp_path / "b.toml")
    assert caught.value.mistakes[0].what == because("file.size", size=1_000_001, limit=1_000_000)


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
