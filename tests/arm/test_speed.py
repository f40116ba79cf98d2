"""The seed's speed rule and its figures."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import msgspec
import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.motors.speed import speed_limits, step_rate

FIGURES = {
    "brazo_joint": (Fraction(46656, 10), Fraction(46656, 10)),
    "antebrazo_joint": (Fraction(100), Fraction(100)),
    "efector_joint": (Fraction(100), Fraction(100)),
}  # [steps/s], [steps/s^2]


@pytest.mark.parametrize("name", FIGURES)
def test_fifteen_rpm_reached_in_one_second_are_the_seeds_figures(rm1: ArmDescription, name: str):
    limits = speed_limits(rm1.joint(name).drive)
    assert (limits.step_rate, limits.step_acceleration) == FIGURES[name]


def test_the_rule_is_rpm_times_steps_per_turn_over_sixty(rm1: ArmDescription):
    assert step_rate(30.0, rm1.joint("antebrazo_joint").steps) == 200


def test_the_same_rule_in_radians_and_metres(rm1: ArmDescription):
    turning, sliding = speed_limits(rm1.joints[0].drive), speed_limits(rm1.joints[2].drive)
    assert turning.velocity == pytest.approx(math.pi / 2)
    assert sliding.velocity == pytest.approx(math.pi / 2 * 0.0225)


def test_the_tighter_limit_wins(rm1: ArmDescription):
    assert rm1.joint("brazo_joint").velocity == 1.57
    assert rm1.joint("efector_joint").velocity == pytest.approx(0.0353429, abs=1e-7)


@pytest.mark.parametrize("key", ["max_speed_rpm", "ramp_time", "jerk_time"])
@pytest.mark.parametrize("value", [0.0, -1.0, 1e-320, 1e308])
def test_a_speed_or_time_that_cannot_be_meant_is_refused_by_name(rm1: ArmDescription, key: str, value: float):
    drive = msgspec.structs.replace(rm1.joints[0].drive, **{key: value})
    with pytest.raises(DescriptionError, match=re.escape(f'joint "brazo_joint": {key} is {value}, it must be')):
        speed_limits(drive)
