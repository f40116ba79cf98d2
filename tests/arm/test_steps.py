"""Steps are exact over many revolutions; a rack counts in metres, and needs the radius of its pinion."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.motors.steps import StepScale, step_scale
from gemelo.schemas.robot import Motor, StepperJoint, Transmission

Q1 = StepScale(Fraction(93312, 5), math.tau)
RACK = StepScale(Fraction(400), math.tau * 0.0225)
SCALES = st.sampled_from([Q1, StepScale(Fraction(400), math.tau), RACK, StepScale(Fraction(6400 * 380, 21), math.tau)])


def test_a_step_of_q1_is_exactly_25_1296_of_a_degree(rm1: ArmDescription):
    scale = rm1.joint("brazo_joint").steps
    assert scale.steps_per_turn == Fraction(93312, 5)
    assert scale.degrees_per_step == Fraction(25, 1296)
    assert 1800 / scale.degrees_per_step == 93312


def test_a_step_of_q2_is_exactly_nine_tenths_of_a_degree(rm1: ArmDescription):
    assert rm1.joint("antebrazo_joint").steps.degrees_per_step == Fraction(9, 10)


def test_a_step_of_the_rack_is_a_third_of_a_millimetre(rm1: ArmDescription):
    assert rm1.joint("efector_joint").steps.resolution == pytest.approx(0.3534e-3, abs=5e-8)


def test_a_position_is_never_off_by_more_than_half_a_step_over_many_revolutions():
    for turns in (0, 1, 1000, 100_000):
        for degrees in (0, 0.9, 13.25, 90, 359.99):
            position = math.radians(turns * 360 + degrees)
            exact = Fraction(position) / Fraction(math.tau) * Q1.steps_per_turn
            assert abs(round(Q1.to_steps(position)) - exact) <= Fraction(1, 2) + Fraction(1, 10**6)


def test_a_revolution_repeated_does_not_drift():
    per_revolution = [Q1.to_q8(math.tau * turn) for turn in range(0, 1001, 5)]
    assert {b - a for a, b in pairwise(per_revolution)} == {93312 * 256}


def test_small_moves_add_up_because_targets_are_absolute():
    """Rounding deltas to two decimals of a degree drifted up to 13.25 degrees a revolution."""
    parts = 7777
    steps = [round(Q1.to_steps(math.tau * part / parts)) for part in range(parts + 1)]
    assert sum(b - a for a, b in pairwise(steps)) == round(float(Q1.steps_per_turn))


def test_metres_of_a_rack_are_not_radians(rm1: ArmDescription):
    joint = rm1.joint("efector_joint")
    assert joint.unit == "m"
    assert joint.steps.to_steps(0.040) == pytest.approx(0.040 / (math.tau * 0.0225) * 400)
    assert joint.steps.to_steps(0.040) != pytest.approx(0.040 / math.tau * 400)


def test_a_rack_without_a_radius_is_refused():
    drive = StepperJoint(
        name="lift",
        wire_name="q3",
        motor=Motor(driver="A4988", pulses_per_turn=400),
        transmission=Transmission.RACK_AND_PINION,
    )
    with pytest.raises(DescriptionError, match=r'joint "lift".*pinion_radius'):
        step_scale(drive)


@pytest.mark.parametrize("ratio", ["", "abc", "1/0", "-4", "0", "nan", "1e999999999", "1/99999999999"])
def test_a_ratio_that_is_none_is_refused_by_name(ratio: str):
    drive = StepperJoint(name="arm", wire_name="q1", motor=Motor(driver="x", pulses_per_turn=200, gear_ratio=ratio))
    with pytest.raises(DescriptionError, match='joint "arm"'):
        step_scale(drive)


@given(SCALES, st.integers(-(2**31), 2**31 - 1))
def test_every_count_of_the_wire_comes_back_exactly(scale: StepScale, count: int):
    assert scale.to_q8(scale.from_q8(count)) == count


@given(SCALES, st.floats(-100.0, 100.0))
def test_a_position_comes_back_within_half_a_256th_of_a_step(scale: StepScale, position: float):
    assert abs(scale.from_q8(scale.to_q8(position)) - position) <= 0.5001 * scale.resolution / 256 + 1e-12


@given(SCALES, st.floats(-100.0, 100.0))
def test_steps_and_back_is_the_position(scale: StepScale, position: float):
    assert scale.to_position(scale.to_steps(position)) == pytest.approx(position, abs=1e-12)
