"""Streamed targets on a device that replaces: a reference, knots along it, and a stop behind them."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.message import Vector
from gemelo.services.stepper_gateway.motion.commanded_path import CommandedPath
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits, StepKnot
from gemelo.services.stepper_gateway.motion.moving_tracker import MovingTracker
from gemelo.services.stepper_gateway.motion.path_version import PathVersion
from gemelo.services.stepper_gateway.motion.reference import (
    EXTRAPOLATED,
    Reference,
    SenderClock,
    parabola_weights,
)
from gemelo.services.stepper_gateway.motion.span_check import extremes, leaving
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.profiles import examples

JOINTS = rm1().joints
LIMITS = Limits.of(JOINTS)
PAROL6 = load_arm(project_root() / "urdf/parol6").joints
NEAR = 0.01  # [s] between near knots


def sampled(period: float, count: int, speed: float = 0.3, bend: float = 0.0) -> Reference:
    """A reference whose first joint moves at `speed`, with `bend`; the others stand."""
    reference = Reference(JOINTS)
    for index in range(count):
        t = index * period
        reference.take(t, (speed * t + 0.5 * bend * t * t, 0.0, 0.1))
    return reference


@given(st.lists(st.floats(0.005, 0.1), min_size=3, max_size=5), st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_a_parabola_through_samples_of_a_parabola_is_that_parabola(
    gaps: list[float], place: float, slope: float, bend: float
) -> None:
    times = [-sum(gaps[index:]) for index in range(len(gaps) + 1)]
    values = [place + t * (slope + t * bend) for t in times]
    found = [sum(w * value for w, value in zip(row, values, strict=True)) for row in parabola_weights(times)]
    assert found == pytest.approx([place, slope, bend], abs=1e-6)


@pytest.mark.parametrize("period", [0.02, 1 / 30, 0.1])
def test_a_steady_motion_is_known_exactly_late_and_ahead(period: float) -> None:
    reference = sampled(period, 8)
    newest = 7 * period
    for ahead in (-0.03, 0.0, 0.05, 0.9 * EXTRAPOLATED):
        place, rate = reference.at(newest + 0.04 + ahead, 0.04)
        assert place[0] == pytest.approx(0.3 * (newest + ahead))
        assert rate[0] == pytest.approx(0.3)
        assert place[1:] == pytest.approx((0.0, 0.1))
    assert reference.at(newest + 1.0, 0.0)[1] == pytest.approx((0.0, 0.0, 0.0))


def test_an_accelerated_motion_is_known_between_its_samples() -> None:
    reference = sampled(1 / 30, 8, speed=0.1, bend=1.0)
    for t in (0.18, 0.2, 7 / 30):
        place, rate = reference.at(t, 0.0)
        assert (place[0], rate[0]) == pytest.approx((0.1 * t + 0.5 * t * t, 0.1 + t))


def test_a_step_is_a_place_to_go_to_and_no_speed() -> None:
    reference = sampled(1 / 30, 8, speed=0.0)
    reference.take(8 / 30, (0.3, 0.0, 0.1))
    place, rate = reference.at(8 / 30 + 0.1, 0.0)
    assert place == pytest.approx((0.3, 0.0, 0.1))
    assert rate == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    for index in (9, 10, 11, 12, 13):
        reference.take(index / 30, (0.3, 0.0, 0.1))
    place, rate = reference.at(13 / 30 + 0.1, 0.0)
    assert place == pytest.approx((0.3, 0.0, 0.1))
    assert rate == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


def test_a_stream_that_begins_in_motion_is_known_as_moving_after_some_targets() -> None:
    """The first slope is no jump for ever: it is compared with the slope before as well."""
    reference = Reference(JOINTS)
    for index in range(8):
        reference.take(index / 30, (0.8 * index / 30, 0.0, 0.1))
    assert reference.at(7 / 30 + 0.05, 0.0)[1][0] == pytest.approx(0.8)


def test_given_velocities_are_taken_and_zeros_are_rest() -> None:
    reference = Reference(JOINTS)
    for index in range(6):
        reference.take(index / 30, (0.01 * index, 0.0, 0.1), (0.0, 0.0, 0.0))
    assert reference.at(1.0, 0.0) == ((0.05, 0.0, 0.1), (0.0, 0.0, 0.0))
    reference.take(6 / 30, (0.06, 0.0, 0.1), (0.3, 0.0, 0.0))
    place, rate = reference.at(6 / 30 + 0.1, 0.0)
    assert (place[0], rate[0]) == pytest.approx((0.09, 0.3))


def test_an_overtaken_target_counts_no_more_and_a_pause_begins_anew() -> None:
    reference = sampled(1 / 30, 8)
    before = reference.newest
    assert not reference.take(6 / 30, (9.0, 9.0, 9.0))
    assert reference.newest == before
    assert reference.take(2.0, (0.5, 0.0, 0.1))
    assert reference.at(2.1, 0.04) == ((0.5, 0.0, 0.1), (0.0, 0.0, 0.0))


def test_a_sender_of_1_khz_is_thinned_and_its_last_target_still_counts() -> None:
    reference = Reference(JOINTS)
    for index in range(501):
        reference.take(index * 1e-3, (0.3 * index * 1e-3, 0.0, 0.1))
    assert reference.newest[0] == 0.3 * 500 * 1e-3
    place, rate = reference.at(0.55, 0.0)
    assert (place[0], rate[0]) == pytest.approx((0.165, 0.3))


def test_the_least_delay_of_a_stamp_counts_as_none() -> None:
    clock, chance = SenderClock(), random.Random(3)
    for index in range(200):
        found = clock.time_of(index / 30 + 77.0, index / 30 + (0.0 if index == 100 else chance.uniform(0.0, 0.02)))
        if 100 <= index < 150:
            assert found == pytest.approx(index / 30)


def test_a_clock_that_is_set_back_is_followed_at_once() -> None:
    clock = SenderClock()
    clock.time_of(50.0, 1.0)
    assert clock.time_of(40.0, 1.033) == pytest.approx(1.033)


moves = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.integers(2, 16)), min_size=1, max_size=6)


@examples(quick=15, full=100)
@given(moves, st.booleans(), st.booleans())
def test_whatever_the_reference_knots_and_stops_keep_every_limit(
    program: list[tuple[float, float, int]], catch_up: bool, six: bool
) -> None:
    joints = PAROL6 if six else JOINTS
    limits, tracker = Limits.of(joints), MovingTracker(joints)
    middle = tuple(0.5 * (max(j.lower, -3.0) + min(j.upper, 3.0)) for j in joints)
    knot, now = Knot.at_rest(middle), 0.0
    for place, rate, count in program:
        wanted = tuple(m + place * 0.5 * (min(j.upper, 3.0) - m) for j, m in zip(joints, middle, strict=True))
        rates = tuple(rate * top for top in limits.velocity)

        def reference(at: float, wanted: Vector = wanted, rates: Vector = rates, begin: float = now):
            return tuple(p + v * (at - begin) for p, v in zip(wanted, rates, strict=True)), rates

        near = tracker.near(knot, now, count, reference, catch_up)
        tail = tracker.tail(near[-1], 24 - count)
        assert tail.knots[-1].is_at_rest
        for before, after, dt in [
            *((a, b, NEAR) for a, b in pairwise([knot, *near])),
            *((a, b, tail.dt_us * 1e-6) for a, b in pairwise([near[-1], *tail.knots[:-1]])),
        ]:
            for i in range(len(joints)):
                assert abs(after.velocity[i]) <= limits.velocity[i]
                assert abs(after.acceleration[i]) <= limits.acceleration[i]
                assert abs(after.acceleration[i] - before.acceleration[i]) <= limits.jerk[i] * dt * (1 + 1e-6)
        knot, now = near[-1], now + count * NEAR


def test_an_arm_on_its_reference_stays_on_it() -> None:
    tracker = MovingTracker(JOINTS)
    knot = Knot((0.0, 0.0, 0.1), (0.3, 0.0, 0.0), (0.0, 0.0, 0.0))
    near = tracker.near(knot, 5.0, 10, lambda t: ((0.3 * (t - 5.0), 0.0, 0.1), (0.3, 0.0, 0.0)), True)
    for index, each in enumerate(near, 1):
        assert each.position == pytest.approx((0.003 * index, 0.0, 0.1))
        assert each.velocity == pytest.approx((0.3, 0.0, 0.0))


cubics = st.tuples(*[st.floats(-2.0, 2.0)] * 4)


@given(cubics)
def test_the_extremes_of_a_cubic_are_those_of_its_values(cubic: tuple[float, float, float, float]) -> None:
    p0, m0, p1, m1 = cubic
    low, high = extremes(p0, m0, p1, m1)
    values = [
        p0 + u * (m0 + u * (3 * (p1 - p0) - 2 * m0 - m1 + u * (2 * (p0 - p1) + m0 + m1)))
        for u in (index / 200 for index in range(201))
    ]
    assert low == pytest.approx(min(values), abs=1e-3)
    assert high == pytest.approx(max(values), abs=1e-3)
    assert low <= min(values) + 1e-12
    assert high >= max(values) - 1e-12


def test_a_path_that_leaves_the_travel_between_two_knots_is_seen() -> None:
    upper = JOINTS[0].upper
    first = Knot((upper - 0.001, 0.0, 0.1), (0.5, 0.0, 0.0), (0.0,) * 3)
    second = Knot((upper - 0.001, 0.0, 0.1), (-0.5, 0.0, 0.0), (0.0,) * 3)
    assert leaving(JOINTS, [first, second], [0.03]) == 0
    assert leaving(JOINTS, [second, first], [0.03]) is None
    assert leaving(JOINTS, [first, second], [0.001]) is None


def version(seq: int, from_us: int, *places: int) -> PathVersion:
    """Knots 10 ms apart, at rest at these places of the first joint [steps]."""
    made = PathVersion(seq)
    for index, place in enumerate(places):
        made.append(
            from_us + 10_000 * index, StepKnot((256 * place,), (0,)), Knot.at_rest((float(place),)), 0.1 * place
        )
    return made


def versions() -> CommandedPath:
    path = CommandedPath()
    path.replace(version(0, 0, 0, 1, 2, 3))
    path.replace(version(1, 20_000, 2, 12, 13))
    path.replace(version(2, 30_000, 12, 22))
    return path


def test_a_states_command_is_that_of_the_newest_version_that_it_knows() -> None:
    path = versions()
    assert [path.at(30_000, next_seq).steps[0] for next_seq in (1, 2, 3)] == [3.0, 12.0, 12.0]
    assert [path.at(40_000, next_seq).steps[0] for next_seq in (1, 2, 3)] == [3.0, 13.0, 22.0]
    assert path.at(10_000, 3).steps[0] == 1.0  # a replacement changes nothing before its first knot


def test_the_knots_to_come_are_those_of_all_versions() -> None:
    path = versions()
    assert path.upcoming(0) == [
        (t, Knot.at_rest((p,))) for t, p in zip(range(0, 50_000, 10_000), (0, 1, 2, 12, 22), strict=True)
    ]
    assert [knot.position[0] for knot in path.knots_between(15_000, 35_000)] == [1, 2, 12]
    assert path.longest_braking(0, 25_000) == pytest.approx(0.2)
    assert (path.end_us, path.last.position) == (40_000, (22.0,))


def test_what_was_not_taken_is_forgotten_with_what_goes_on_from_it_and_comes_back_if_it_was() -> None:
    path = versions()
    path.forget(1, 1)
    assert path.end_us == 30_000
    assert path.at(40_000).steps[0] == 3.0
    path.revive(1)
    assert path.at(40_000).steps[0] == 13.0
    path.revive(2)
    assert path.at(40_000).steps[0] == 22.0
    path.forget(0, 2)
    assert path.end_us == 30_000  # the first one stays: a stream is no stream without it


def test_versions_that_no_state_can_mean_any_more_are_dropped() -> None:
    path = versions()
    path.prune(25_000, 3)
    assert path.at(20_000, 1).steps[0] == 2.0  # of chunk 1, the oldest that is kept
    path.forget(2, 2)
    assert path.end_us == 40_000
    assert math.isclose(path.at(40_000).steps[0], 13.0)
