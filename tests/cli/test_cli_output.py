"""YAML that any reader takes, tables that align, rates with known answers."""

import math
from enum import IntEnum

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.schemas.joints import JointState
from gemelo.tools.cli.bus.messages import dump
from gemelo.tools.cli.bus.topic_rates import RateWindow
from gemelo.tools.cli.common.text_table import table

texts = st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
scalars = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | texts
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(texts, inner, max_size=4), max_leaves=12
)


@given(st.dictionaries(texts, values, max_size=5))
def test_any_yaml_reader_gets_back_what_was_echoed(value):
    assert yaml.safe_load(dump(value)) == value


def test_a_message_is_echoed_field_by_field():
    message = JointState(stamp=5, name=("brazo_joint", "q"), position=(0.5, -1e-7))
    assert dump(message) == ("stamp: 5\nname: [brazo_joint, q]\nposition: [0.5, -1.0e-07]\nvelocity: []\neffort: []\n"
                             "commanded: false\n")  # fmt: skip


def test_an_enum_is_a_number_with_its_name_beside_it():
    assert "mode: 4  # RUN\n" in dump(DeviceState(mode=DeviceMode.RUN))
    assert issubclass(DeviceMode, IntEnum)


def test_nested_sequences_stay_readable():
    assert dump({"points": [{"x": 1, "a": [1, 2]}, {"x": 2}]}) == "points:\n  - x: 1\n    a: [1, 2]\n  - x: 2\n"


def test_a_steady_stream_has_its_rate_and_no_deviation():
    window = RateWindow()
    for index in range(51):
        window.add(index * 0.02)
    assert str(window.report()) == ("average rate: 50.000\n\tmin: 0.020s max: 0.020s std dev: 0.00000s window: 51")


def test_an_uneven_stream_has_known_statistics():
    window = RateWindow()
    for time in (0.0, 0.01, 0.04, 0.05, 0.08):
        window.add(time)
    assert str(window.report()) == "average rate: 50.000\n\tmin: 0.010s max: 0.030s std dev: 0.01000s window: 5"


def test_one_message_has_no_rate():
    window = RateWindow()
    assert window.report() is None
    window.add(1.0)
    assert window.report() is None


@given(st.lists(st.floats(0.001, 10.0), min_size=2, max_size=200), st.integers(2, 50))
def test_the_window_forgets_what_is_older(gaps, size):
    window, time = RateWindow(size), 0.0
    window.add(time)
    for gap in gaps:
        time += gap
        window.add(time)
    recent = gaps[-(size - 1) :]
    assert f"window: {min(size, len(gaps) + 1)}" in str(window.report())
    assert window.report().rate == pytest.approx(len(recent) / math.fsum(recent), rel=1e-3, abs=1e-3)


def test_numbers_stand_to_the_right_and_words_to_the_left():
    assert table(("joint", "error [steps]"), [("brazo", "-0.12"), ("q", "10.5")]) == (
        "joint  error [steps]\n-----  -------------\nbrazo          -0.12\nq               10.5"
    )
