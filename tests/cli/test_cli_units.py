"""Units on the command line: a value that a person writes becomes SI, and nothing else does."""

import math
from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.units import ANGLE, FAR, LENGTH, SHARE, SPEED, parse_joints, parse_quantity, show
from gemelo.tools.cli.main import run


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
    if not suffix and abs(number) > FAR["m"]:  # which was meant in millimetres
        with pytest.raises(CommandError, match="did you mean"):
            parse_quantity(f"{number!r}", quantity)
        return
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


@pytest.mark.parametrize(
    ("text", "quantity", "said"),
    [
        ("250", LENGTH, "250 without a unit is in m, and more than 10 m: did you mean 250mm?"),
        ("-150", LENGTH, "did you mean -150mm?"),
        ("25", LENGTH, "did you mean 25mm or 0.25 for 25 cm?"),
        ("250", SPEED, "250 without a unit is in m/s, and more than 10 m/s: did you mean 250mm/s?"),
        ("0,25", LENGTH, '"0,25" is not a length: the decimal sign is a point: did you mean 0.25?'),
        ("-,5", LENGTH, "did you mean -0.5?"),
        ("0,250", LENGTH, "did you mean 0.250?"),
        ("1,250mm", LENGTH, "did you mean 1.250mm or 1250mm?"),
        ("30,5deg", ANGLE, '"30,5deg" is not an angle: the decimal sign is a point: did you mean 30.5deg?'),
        ("12,5%", SHARE, "did you mean 12.5%?"),
    ],
)
def test_a_number_that_was_likely_meant_otherwise_is_refused_with_the_likely_meaning(text, quantity, said):
    with pytest.raises(CommandError) as refused:
        parse_quantity(text, quantity)
    assert said in str(refused.value)


def test_what_is_far_with_its_unit_and_what_is_near_without_are_taken():
    assert parse_quantity("250m", LENGTH) == 250.0
    assert parse_quantity("9.5", LENGTH) == 9.5
    assert parse_quantity("250mm", LENGTH) == 0.25


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["move", "--to", "250", "150", "100"], "did you mean 250mm?"),
        (["move", "--to", "0,25", "0.15", "0.1"], "did you mean 0.25?"),
        (["move", "--to", "0.2", "-0,15", "0.1"], "did you mean -0.15?"),
        (["ik", "--to", "250", "150", "100"], "did you mean 250mm?"),
        (["move", "--to", "0.2", "0.1", "0.1", "--along", "0,5", "0", "1"], "did you mean 0.5?"),
        (["move", "--joints", "brazo_joint=30,5deg"], "did you mean 30.5deg?"),
        (["move", "--joints", "efector_joint=40"], "did you mean 40mm"),
    ],
)
def test_a_command_line_offers_the_likely_meaning(words, said, capsys):
    try:
        code = run(["--simulate", *words])
    except SystemExit as ended:
        code = ended.code
    assert code == ExitCode.USAGE
    assert said in capsys.readouterr().err
