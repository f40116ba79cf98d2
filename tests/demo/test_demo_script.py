"""The demonstration's motions suit whatever arm there is."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import load_arm
from gemelo.tools.demo.script import SINE_PERIOD, sine_of, tour

ARM = load_arm(Path(__file__).parents[2] / "urdf/rm1")


@given(st.sampled_from(ARM.joints), st.floats(0.0, 1.0), st.floats(0.0, 20.0))
def test_the_sine_stays_within_position_and_speed(joint, share, time):
    sine = sine_of(joint, joint.lower + share * (joint.upper - joint.lower))
    assert joint.lower - 1e-9 <= sine.at(time) <= joint.upper + 1e-9
    speed = abs(sine.at(time + 1e-4) - sine.at(time)) / 1e-4
    assert speed < joint.velocity
    assert sine.amplitude > 0.0


@pytest.mark.parametrize("joint", ARM.joints, ids=lambda joint: joint.name)
def test_the_sine_ends_where_it_began(joint):
    sine = sine_of(joint, 0.0)
    assert sine.at(2.0 * SINE_PERIOD) == pytest.approx(sine.at(0.0))


def test_the_tour_has_at_least_eight_stops_of_every_kind():
    stops = tour(ARM)
    assert len(stops) >= 8
    assert {name for stop in stops for name in stop.target} == {"position", "joints", "named"}


def test_the_joint_goals_are_within_the_limits():
    for stop in tour(ARM):
        for joint, position in zip(ARM.joints, stop.target.get("joints", ()), strict="joints" in stop.target):
            assert joint.is_within(position)
