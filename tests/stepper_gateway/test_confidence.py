"""The model of the ledger: what lowers the confidence, what verifications teach, and what the tool makes of it."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.libraries.arm.motors.torque import BEYOND, torque_share
from gemelo.schemas.ledger import VerifiedBy
from gemelo.services.stepper_gateway.ledger.confidence import (
    AGE,
    CLEAN,
    PROOF,
    TURNS,
    Evidence,
    after_verification,
    confidence,
    strong_enough,
)
from gemelo.services.stepper_gateway.ledger.joint_watch import WATCHED, JointSample, JointWatch
from gemelo.services.stepper_gateway.ledger.tool_error import CERTAIN, bounds, tool_shift
from gemelo.tools.virtual_arm.virtual_arm import rm1

NOW = 1_800_000_000_000_000_000  # [ns]
SECOND = 1_000_000_000
HOMED = Evidence(verified_by=VerifiedBy.HOMING, verified_at=NOW)
CYCLE = 8.0
LOADS = st.floats(0.0, 3.0)


def verified(evidence: Evidence, off: int | None, by: VerifiedBy = VerifiedBy.HOMING) -> Evidence:
    return after_verification(evidence, by, 100, off, CYCLE, NOW)


def test_a_joint_that_was_just_homed_is_sure_and_one_that_never_was_is_not() -> None:
    assert confidence(HOMED, NOW) == 1.0
    assert confidence(Evidence(), NOW) == 0.0


@given(st.floats(0.0, 1e6), st.floats(0.0, 1e6), LOADS, LOADS, st.integers(0, 10**7), st.floats(0.0, 3.0))
def test_turns_loads_time_and_incidents_only_ever_lower_it(
    turns: float, more_turns: float, load: float, other: float, seconds: int, incidents: float
) -> None:
    before = replace(HOMED, turns=turns, load=min(load, other))
    sure = confidence(before, NOW)
    assert 0.0 <= sure <= 1.0
    assert confidence(replace(before, turns=turns + more_turns), NOW) <= sure
    assert confidence(replace(before, load=max(load, other)), NOW) <= sure
    assert confidence(before, NOW + seconds * SECOND) <= sure
    assert confidence(replace(before, incidents=incidents), NOW) <= sure


def test_after_the_stated_turns_and_the_stated_time_1_e_is_left() -> None:
    assert confidence(replace(HOMED, turns=TURNS), NOW) == pytest.approx(math.exp(-1.0))
    assert confidence(HOMED, NOW + round(AGE) * SECOND) == pytest.approx(math.exp(-1.0))
    assert confidence(HOMED, NOW - round(AGE) * SECOND) == 1.0  # the clock was set back


def test_what_a_verification_has_proven_is_trusted_in_part_and_more_is_not() -> None:
    proven = verified(replace(HOMED, load=0.4), off=1)
    assert proven.proven == 0.4
    assert strong_enough(replace(proven, load=0.4 * PROOF)) == 1.0
    unknown = strong_enough(replace(HOMED, load=0.5))
    assert unknown < strong_enough(replace(proven, load=0.5)) < 1.0


def test_a_homing_from_an_unknown_place_proves_nothing() -> None:
    assert verified(replace(HOMED, load=0.4), off=None).proven == 0.0
    assert verified(replace(Evidence(), load=0.4), off=0).proven == 0.0  # never verified before
    by_eye = replace(HOMED, verified_by=VerifiedBy.REFERENCE, load=0.4)
    assert verified(by_eye, off=40).refuted == 0.0  # a person's place is no step count


def test_a_motor_that_has_lost_steps_is_not_trusted_with_that_load_until_it_was_clean_three_times() -> None:
    found = verified(replace(HOMED, load=0.3, proven=0.25), off=-16)
    assert (found.proven, found.refuted, found.found_off) == (0.0, 0.3, -16)
    for _ in range(CLEAN - 1):
        assert strong_enough(replace(found, load=0.3)) == 0.0
        assert strong_enough(replace(found, load=0.29)) < 0.2
        found = verified(replace(found, load=0.31), off=0)
        assert found.refuted == 0.3
    found = verified(replace(found, load=0.31), off=0)
    assert (found.proven, found.refuted) == (0.31, 0.0)


def test_less_than_half_a_cycle_is_the_spread_of_the_switch() -> None:
    assert verified(replace(HOMED, load=0.3), off=3).refuted == 0.0
    assert verified(replace(HOMED, load=0.3), off=4).refuted == 0.3


def test_a_switch_that_was_passed_corrects_nothing_so_what_it_finds_stays() -> None:
    found = verified(replace(HOMED, load=0.3), off=24, by=VerifiedBy.SWITCH)
    assert found.lost == 24
    assert confidence(found, NOW) == 0.0
    assert verified(found, off=24).lost == 0  # the homing that follows


def watch_of(index: int) -> JointWatch:
    return JointWatch(rm1().joints[index])


def test_the_load_is_the_share_of_the_pull_out_torque_that_inertia_and_friction_ask_for() -> None:
    motor = rm1().joints[0].drive.motor
    assert torque_share(motor, 0.0, 0.0) == pytest.approx(0.05 / 1.2)
    acceleration = 1.0 / (math.tau / 400) / 7.5e-5  # [steps/s^2] for 1 N m
    assert torque_share(motor, 2000.0, acceleration) == pytest.approx(1.05)
    assert torque_share(motor, 20_000.0, 0.0) == BEYOND


def test_between_two_states_turns_and_load_add_up() -> None:
    watch = watch_of(0)
    moved = watch.between(HOMED, JointSample(0, 0, 0.0), JointSample(20_000, 400, 2000.0))
    assert moved.turns == 1.0
    assert moved.load == pytest.approx(torque_share(watch.joint.drive.motor, 2000.0, 100_000.0))
    assert watch.between(HOMED, JointSample(0, 0, 0.0), JointSample(20_000, 0, 0.0)) is HOMED


def test_a_motion_that_nobody_has_watched_counts_as_the_hardest_there_is() -> None:
    watch = watch_of(0)
    late = round((WATCHED + 0.1) * 1e6)
    assert watch.between(HOMED, JointSample(0, 0, 0.0), JointSample(late, 40, 0.0)).load == watch.hardest
    assert watch.between(HOMED, JointSample(0, 0, 0.0), JointSample(late, 0, 0.0)) is HOMED


COLUMNS = ((0.0, 0.3, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 1.0))


def test_the_bound_gives_up_the_least_sure_joints_until_the_others_reach_the_level() -> None:
    joints, travelled = rm1().joints, (5000.0, 100.0, 300.0)
    assert bounds(joints, (0.99, 0.99, 0.99), travelled, 0.95) == (CERTAIN,) * 3
    assert bounds(joints, (0.99, 0.9, 0.99), travelled, 0.95) == (CERTAIN, 100.0, CERTAIN)
    assert bounds(joints, (0.97, 0.9, 0.97), travelled, 0.95) == (5000.0, 100.0, CERTAIN)
    whole = (joints[0].upper - joints[0].lower) * joints[0].steps.per_unit
    assert bounds(joints, (0.0, 1.0, 1.0), (math.inf, 0.0, 0.0), 0.95) == pytest.approx((whole, CERTAIN, CERTAIN))


def test_the_tool_is_off_along_chords_and_slides() -> None:
    joints = rm1().joints
    quarter = 0.25 * 18662.4
    assert tool_shift(joints, COLUMNS, (quarter, 0.0, 0.0)) == pytest.approx(0.3 * math.sqrt(2.0))
    assert tool_shift(joints, COLUMNS, (1e9, 0.0, 0.0)) == pytest.approx(0.6)  # never farther than across
    assert tool_shift(joints, COLUMNS, (0.0, 0.0, 10.0)) == pytest.approx(10.0 / joints[2].steps.per_unit)
