"""Curves in the terminal: every dot where its value is, axes with units, and what cannot be drawn is refused."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import FrameTransforms
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.message import Message
from gemelo.schemas.topics import JOINT_STATES, STEP_ERRORS, Delivery, Topic
from gemelo.tools.cli.bus import living_topics
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.terminal import COLOUR, LiveBlock, cut
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch.chart import ACROSS, BLANK, DOTS, DOWN, LABEL, ChartCurve, chart
from gemelo.tools.cli.watch.plot import Field, Plot, plot
from tests.runtime.support import spinning

COLUMNS, ROWS = 60, 10
VALUES = st.floats(-1e6, 1e6)


def dots(text: str) -> set[tuple[int, int]]:
    """(column, row) of all dots of a panel without colours, from the upper left."""
    found = set()
    rows = [line[LABEL + 2 :] for line in text.splitlines() if line[LABEL + 1 : LABEL + 2] in ("│", "┤")]
    for row, line in enumerate(rows):
        for column, letter in enumerate(line):
            bits = max(ord(letter) - BLANK, 0)
            for y in range(DOWN):
                for x in range(ACROSS):
                    if bits & DOTS[y][x]:
                        found.add((column * ACROSS + x, row * DOWN + y))
    return found


def numbers(text: str) -> list[tuple[int, float]]:
    """The row and the value of each number on the vertical axis."""
    rows = [line for line in text.splitlines() if line[LABEL + 1 : LABEL + 2] in ("│", "┤")]
    return [(row, float(line[:LABEL])) for row, line in enumerate(rows) if line[:LABEL].strip()]


@given(st.lists(VALUES, min_size=1, max_size=40))
def test_every_point_is_a_dot_within_the_panel_and_the_highest_is_above_the_lowest(values: list[float]) -> None:
    points = [(float(index), value) for index, value in enumerate(values)]
    text = chart([ChartCurve("a.b", points)], 0.0, float(max(len(values) - 1, 1)), COLUMNS, ROWS)
    drawn = dots(text)
    assert {x for x, _ in drawn} <= set(range((COLUMNS - LABEL - 2) * ACROSS))
    assert {y for _, y in drawn} <= set(range(ROWS * DOWN))
    assert all(len(line) <= COLUMNS for line in text.splitlines()[1:])
    if max(values) - min(values) > 0.01 * max(map(abs, values)):
        assert min(y for _, y in drawn) < ROWS * DOWN / 4 < 3 * ROWS * DOWN / 4 < max(y for _, y in drawn) + 1


@given(VALUES, st.floats(1e-3, 1e6))
def test_the_numbers_of_the_axis_are_where_their_values_are_drawn(low: float, span: float) -> None:
    text = chart([ChartCurve("a.b", [(0.0, low), (10.0, low + span)])], 0.0, 10.0, COLUMNS, ROWS)
    told = numbers(text)
    assert told
    assert [row for row, _ in told] == sorted((row for row, _ in told))
    values = [value for _, value in told]
    assert values == sorted(values, reverse=True)
    if span > 0.1 * max(abs(low), abs(low + span)):
        middle_row = sum(row for row, _ in told) / len(told)
        middle = sum(values) / len(values)
        share = (low + 1.05 * span - middle) / (1.1 * span)
        assert abs(middle_row - share * (ROWS - 1)) < 1.01


def test_a_gap_is_not_joined() -> None:
    whole = [(float(index), 1.0 + index % 2) for index in range(11)]
    gap = [(time, math.nan if 3.0 <= time <= 7.0 else value) for time, value in whole]
    middle = range((COLUMNS - LABEL - 2) * ACROSS * 4 // 10, (COLUMNS - LABEL - 2) * ACROSS * 6 // 10)
    assert any(x in middle for x, _ in dots(chart([ChartCurve("a.b", whole)], 0.0, 10.0, COLUMNS, ROWS)))
    assert not any(x in middle for x, _ in dots(chart([ChartCurve("a.b", gap)], 0.0, 10.0, COLUMNS, ROWS)))


def test_a_panel_names_its_curve_with_unit_newest_value_and_range_and_counts_the_time_back() -> None:
    text = chart([ChartCurve("joint_states.position[0]", [(0.0, -0.5), (10.0, 0.25)])], 0.0, 10.0, COLUMNS, ROWS, "rad")
    lines = text.splitlines()
    assert lines[0] == "joint_states.position[0] [rad]: 0.25, from -0.5 to 0.25"
    assert "-10 s" in lines[-1]
    assert lines[-1].endswith("0 s")
    assert len(lines) == ROWS + 3


@pytest.mark.parametrize(
    ("kind", "path", "unit"),
    [
        (JointState, "position[0]", "rad or m"),
        (JointState, "velocity", "rad/s or m/s"),
        (StepErrors, "error[1]", "steps"),
        (FrameTransforms, "transforms[0].transform.translation[2]", "m"),
        (JointState, "name", ""),
    ],
)
def test_the_unit_is_the_one_of_the_field_s_declaration(kind: type[Message], path: str, unit: str) -> None:
    assert FieldPath(kind, path).unit == unit


def test_without_colours_each_curve_has_its_own_panel_and_with_them_each_unit() -> None:
    curves = Plot(10.0)
    for index in range(2):
        curves.add(f"joint_states.position[{index}]", "rad", 1.0, 0.5)
    curves.add("step_errors.error[0]", "steps", 1.0, 0.1)
    assert curves.text(2.0, 80, None, is_coloured=False).count("└") == 3
    coloured = curves.text(2.0, 80, 40, is_coloured=True)
    assert coloured.count("└") == 2
    assert len(coloured.splitlines()) <= 40
    assert coloured.index("position[0]") < coloured.index("position[1]") < coloured.index("└")


def test_points_older_than_the_window_are_forgotten() -> None:
    curves = Plot(10.0)
    for time in range(31):
        curves.add("a.b", "", float(time), float(time))
    assert "from 20 to 30" in curves.text(30.0, 80, None, is_coloured=False)


def test_more_curves_than_can_be_told_apart_are_refused() -> None:
    curves = Plot(10.0)
    for index in range(8):
        curves.add(f"a.b[{index}]", "", 0.0, 0.0)
    with pytest.raises(CommandError, match=r"a\.b\[8\] is more than the 8 curves"):
        curves.add("a.b[8]", "", 0.0, 0.0)


def test_a_field_without_a_number_is_refused_by_name() -> None:
    with pytest.raises(CommandError, match=r"joint_states\.name has no number"):
        list(Field(JOINT_STATES, "name").numbers(JointState(name=("a",))))


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("plot joint_states", "names no field: say joint_states.FIELD"),
        ("plot joint_states.positio[0]", 'did you mean "position"'),
    ],
)
def test_what_cannot_be_drawn_is_told_before_anything_is_connected(line, said, monkeypatch, capsys) -> None:
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    assert run(line.split()) is ExitCode.USAGE
    assert said in capsys.readouterr().err


def test_fields_of_several_topics_are_drawn_as_they_come(session, gateway, capsys) -> None:
    fields = [Field(JOINT_STATES, "position"), Field(JOINT_STATES, "velocity[0]"), Field(STEP_ERRORS, "error[0]")]
    assert plot(session, fields[:2], 1.0, count=5) is ExitCode.OK
    said = capsys.readouterr().out
    assert re.search(r"^joint_states\.position\[0\] \[rad or m\]: ", said, re.MULTILINE)
    assert re.search(r"^joint_states\.position\[1\] \[rad or m\]: ", said, re.MULTILINE)
    assert re.search(r"^joint_states\.velocity\[0\] \[rad/s or m/s\]: ", said, re.MULTILINE)
    assert "\x1b" not in said


def test_on_a_terminal_the_picture_is_drawn_again_and_again_in_colours(session, gateway, capsys) -> None:
    plot(session, [Field(JOINT_STATES, "position[0]")], 0.7, is_once=True, block=LiveBlock(is_live=True))
    assert capsys.readouterr().out.count("\x1b[J") >= 2


@given(st.lists(st.sampled_from(["a", "⣀", " ", "\x1b[36m", "\x1b[0m"]), max_size=60), st.integers(0, 30))
def test_a_line_is_cut_by_what_is_seen_of_it_and_no_colour_is_torn(parts: list[str], columns: int) -> None:
    line = "".join(parts)
    after = cut(line, columns)
    assert COLOUR.sub("", after) == COLOUR.sub("", line)[:columns]
    assert COLOUR.findall(after) == COLOUR.findall(line)


class Depth(Message, frozen=True, kw_only=True):
    metres: float = 0.0
    is_wet: bool = True


DEPTH = Topic("depth", Depth, Delivery.LATEST, 20.0, False, "diver", "how deep")


@pytest.fixture
def diver(deployment, network) -> Iterator[None]:
    with Node("diver", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        publisher = node.publisher(DEPTH)
        with spinning(node, lambda now: publisher.put(Depth(metres=1.5)), rate=20.0):
            yield


def test_the_topic_of_a_user_s_node_is_drawn_without_a_unit(session, diver, capsys) -> None:
    found = living_topics.topic_on(session, "depth")
    assert plot(session, [Field(found, "metres"), Field(found, "is_wet")], 1.0, count=3) is ExitCode.OK
    said = capsys.readouterr().out
    assert "depth.metres: 1.5, from 1.5 to 1.5" in said
    assert "depth.is_wet: 1, from 1 to 1" in said
