"""What a person writes becomes SI, and nothing else does."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.cli.errors import CommandError, ExitCode
from services.cli.units import parse_joints, parse_value, show


@dataclass(frozen=True)
class SomeJoint:
    name: str
    wire_name: str
    unit: str


JOINTS = (SomeJoint("brazo_joint", "q1", "rad"), SomeJoint("efector_joint", "q3", "m"))
numbers = st.floats(-1e6, 1e6, allow_nan=False)


@given(numbers)
def test_degrees_become_radians_and_back(degrees):
    value = parse_value(f"{degrees!r}deg", "rad", "joint")
    assert value == pytest.approx(math.radians(degrees))
    assert float(show(value, "rad", 6).split()[0]) == pytest.approx(degrees, abs=1e-6)


@given(numbers)
def test_millimetres_become_metres(millimetres):
    assert parse_value(f"{millimetres!r}mm", "m", "joint") == pytest.approx(millimetres / 1000.0)


@given(numbers, st.sampled_from([("rad", "rad"), ("m", "m"), ("", "rad"), ("", "m")]))
def test_si_units_and_bare_numbers_are_taken_as_they_are(number, suffix_and_unit):
    suffix, unit = suffix_and_unit
    assert parse_value(f"{number!r}{suffix}", unit, "joint") == number


@pytest.mark.parametrize(("text", "unit"), [("30deg", "m"), ("1rad", "m"), ("40mm", "rad"), ("0.04m", "rad")])
def test_a_unit_of_the_wrong_kind_is_refused(text, unit):
    with pytest.raises(CommandError, match=r"must be in (m or mm|deg or rad)") as refused:
        parse_value(text, unit, 'joint "efector_joint"')
    assert refused.value.code is ExitCode.USAGE
    assert "efector_joint" in str(refused.value)


@pytest.mark.parametrize("text", ["", "deg", "1..2deg", "nan", "inf", "0x10", "1e999rad", "3 turns"])
def test_what_is_no_value_is_refused_by_name(text):
    with pytest.raises(CommandError, match="brazo_joint"):
        parse_joints([f"brazo_joint={text}"], JOINTS)


def test_joints_are_known_by_both_their_names():
    assert parse_joints(["q1=90deg", "efector_joint=40mm"], JOINTS) == {
        "brazo_joint": math.radians(90.0),
        "efector_joint": 0.04,
    }


def test_an_unknown_joint_is_answered_with_the_nearest():
    with pytest.raises(CommandError, match='did you mean "brazo_joint"'):
        parse_joints(["braso_joint=1"], JOINTS)


@pytest.mark.parametrize(("given_", "reason"), [(["q1"], "not a joint and its value"), (["q1=1", "q1=2"], "twice")])
def test_what_is_no_assignment_is_refused(given_, reason):
    with pytest.raises(CommandError, match=reason):
        parse_joints(given_, JOINTS)
