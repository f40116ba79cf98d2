"""Trajectories between their points."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.interpolation import TrajectorySampler, cubic, quintic
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint

VALUE = st.floats(-10.0, 10.0)
TIME = st.floats(0.01, 10.0)


def point(t: float, p: float, v: float | None = None, a: float | None = None) -> TrajectoryPoint:
    return TrajectoryPoint(
        positions=(p,),
        velocities=() if v is None else (v,),
        accelerations=() if a is None else (a,),
        time_from_start=t,
    )


def sampler(*points: TrajectoryPoint) -> TrajectorySampler:
    return TrajectorySampler(JointTrajectory(joint_names=("a",), points=points))


def test_positions_only_is_linear():
    s = sampler(point(0.0, 0.0), point(2.0, 1.0))
    assert s.at(0.5) == ((0.25,), (0.5,), (0.0,))


def test_with_velocities_it_is_cubic():
    s = sampler(point(0.0, 0.0, 0.0), point(1.0, 1.0, 0.0))
    (p,), (v,), (a,) = s.at(0.5)
    assert (p, v, a) == (pytest.approx(0.5), pytest.approx(1.5), pytest.approx(0.0))


def test_with_accelerations_it_is_quintic():
    s = sampler(point(0.0, 0.0, 0.0, 0.0), point(1.0, 1.0, 0.0, 0.0))
    (p,), (v,), _ = s.at(0.5)
    assert (p, v) == (pytest.approx(0.5), pytest.approx(1.875))


def test_a_segment_is_as_smooth_as_its_poorer_end():
    s = sampler(point(0.0, 0.0), point(1.0, 1.0, 0.0, 0.0))
    assert s.at(0.5)[1] == (1.0,)


def test_it_is_held_at_its_ends():
    s = sampler(point(0.0, 1.0, 0.0), point(1.0, 2.0, 0.0))
    assert s.at(-1.0) == ((1.0,), (0.0,), (0.0,))
    assert s.at(5.0) == ((2.0,), (0.0,), (0.0,))
    assert s.duration == 1.0


def test_a_start_fills_the_time_before_the_first_point():
    trajectory = JointTrajectory(joint_names=("a",), points=(point(1.0, 1.0),))
    s = TrajectorySampler(trajectory, start=point(0.0, 0.0))
    assert s.at(0.25)[0] == (0.25,)


LEGS = st.lists(st.tuples(st.floats(0.05, 5.0), VALUE, VALUE, VALUE), min_size=2, max_size=6)


@given(LEGS, st.integers(0, 2))
def test_it_is_as_continuous_as_its_fields_promise_and_passes_through_every_point(
    legs: list[tuple[float, float, float, float]], derivatives: int
):
    """Positions never jump; velocities do not with velocities, nor accelerations with accelerations."""
    times = list(itertools.accumulate((dt for dt, *_ in legs), initial=0.0))[:-1]
    known = [values[: derivatives + 1] for _, *values in legs]
    s = sampler(*(point(t, *values) for t, values in zip(times, known, strict=True)))
    for t, values in zip(times, known, strict=True):
        here = [value for (value,) in s.at(t)][: derivatives + 1]
        assert here == pytest.approx(values, abs=1e-9)
        if t > 0.0:
            nearly = [value for (value,) in s.at(math.nextafter(t, 0.0))][: derivatives + 1]
            assert nearly == pytest.approx(values, rel=1e-6, abs=1e-4)


def test_no_points_is_an_error():
    with pytest.raises(ValueError, match="without points"):
        sampler()


def test_time_that_stands_is_an_error():
    s = sampler(point(0.0, 0.0), point(1.0, 1.0), point(1.0, 2.0), point(2.0, 2.0))
    assert s.at(0.5)[0] == (0.5,)
    assert s.at(1.5)[0] == (2.0,)


def value(coefficients: tuple[float, ...], t: float, derivative: int = 0) -> float:
    for _ in range(derivative):
        coefficients = tuple(k * c for k, c in enumerate(coefficients))[1:]
    return sum(c * t**k for k, c in enumerate(coefficients))


@given(VALUE, VALUE, VALUE, VALUE, TIME)
def test_a_cubic_meets_both_ends(p0: float, v0: float, p1: float, v1: float, dt: float):
    c = cubic(p0, v0, p1, v1, dt)
    found = (value(c, 0.0), value(c, 0.0, 1), value(c, dt), value(c, dt, 1))
    assert found == pytest.approx((p0, v0, p1, v1), abs=1e-6)


@given(VALUE, VALUE, VALUE, VALUE, VALUE, VALUE, TIME)
def test_a_quintic_meets_both_ends(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, dt: float):
    c = quintic(p0, v0, a0, p1, v1, a1, dt)
    found = (value(c, dt), value(c, dt, 1), value(c, dt, 2) * dt, value(c, 0.0, 2))
    assert found == pytest.approx((p1, v1, a1 * dt, a0), abs=1e-5)


@given(VALUE, VALUE, VALUE, VALUE, TIME, st.floats(0.0, 1.0))
def test_a_quintic_through_a_cubic_is_that_cubic(a: float, b: float, c: float, d: float, dt: float, share: float):
    """So a jerk-limited profile sampled where its jerk changes is met exactly."""
    known = (a, b, c, d)
    ends = [(value(known, t), value(known, t, 1), value(known, t, 2)) for t in (0.0, dt)]
    found = quintic(*ends[0], *ends[1], dt)
    t = share * dt
    scale = 1.0 + max(abs(value(known, u, k)) for u in (0.0, dt) for k in (0, 1, 2)) * (1 + dt) ** 2
    assert value(found, t) == pytest.approx(value(known, t), abs=1e-12 * scale)
