"""Units on the command line: a value that a person writes becomes SI, and nothing else does."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from services.cli.errors import CommandError, ExitCode
from services.cli.units import ANGLE, LENGTH, parse_joints, parse_quantity, show


@dataclass(frozen=True)
class SomeJoint:
    name: str
    wire_name: str
    unit: str


JOINTS = (SomeJoint("brazo_joint", "q1", "rad"), SomeJoint("efector_joint", "q3", "m"))
numbers = st.floats(-1e6, 1e6, allow_nan=False)


@given(numbers)
def test_degrees_become_radians_and_back(degrees):
    value = parse_quantity(f"{degrees!r}deg", ANGLE)
    assert value == pytest.approx(math.radians(degrees))
    assert float(show(value, "rad", 6).split()[0]) == pytest.approx(degrees, abs=1e-6)


@given(numbers)
def test_millimetres_become_metres(millimetres):
    assert parse_quantity(f"{millimetres!r}mm", LENGTH) == pytest.approx(millimetres / 1000.0)


@given(numbers, st.sampled_from([("rad", ANGLE), ("m", LENGTH), ("", LENGTH)]))
def test_si_units_and_bare_lengths_are_taken_as_they_are(number, suffix_and_quantity):
    suffix, quantity = suffix_and_quantity
    assert parse_quantity(f"{number!r}{suffix}", quantity) == number


@given(numbers.filter(bool))
def test_an_angle_without_a_unit_is_refused_with_both_readings(number):
    with pytest.raises(CommandError, match=r"what: .*deg or .*rad\?$") as refused:
        parse_quantity(f"{number!r}", ANGLE)
    readings = str(refused.value).split("what: ")[1].rstrip("?").split(" or ")
    assert [parse_quantity(text, ANGLE) for text in readings] == pytest.approx([math.radians(number), number])


@pytest.mark.parametrize(("text", "quantity"), [("30deg", LENGTH), ("1rad", LENGTH), ("40mm", ANGLE), ("0.04m", ANGLE)])
def test_a_unit_of_the_wrong_kind_is_refused(text, quantity):
    with pytest.raises(CommandError, match=r"must be in (m or mm|deg or rad)") as refused:
        parse_quantity(text, quantity, 'joint "efector_joint"')
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


@pytest.mark.parametrize(
    ("given_", "reason"), [(["q1"], "not a joint and its value"), (["q1=1rad", "q1=2rad"], "twice")]
)
def test_what_is_no_assignment_is_refused(given_, reason):
    with pytest.raises(CommandError, match=reason):
        parse_joints(given_, JOINTS)
