"""Rigid transforms on tuples, held against pinocchio."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.frames.transforms import (
    IDENTITY,
    Rigid,
    compose,
    from_axis_angle,
    from_message,
    from_rpy,
    interpolate,
    inverse,
    rotate,
    slerp,
    to_message,
)
from gemelo.schemas.frames import Transform

ANGLE = st.floats(-math.pi, math.pi)
POINT = st.tuples(*[st.floats(-2.0, 2.0)] * 3)
RIGID = st.builds(lambda point, r, p, y: (point, from_rpy(r, p, y)), POINT, ANGLE, ANGLE, ANGLE)


def se3(rigid: Rigid) -> pin.SE3:
    return pin.SE3(pin.Quaternion(np.array(rigid[1])).normalized().matrix(), np.array(rigid[0]))


def is_same(ours: Rigid, theirs: pin.SE3) -> bool:
    return bool(np.allclose(se3(ours).homogeneous, theirs.homogeneous, atol=1e-9))


@given(RIGID, RIGID)
def test_composition_is_pinocchios(a: Rigid, b: Rigid):
    assert is_same(compose(a, b), se3(a) * se3(b))


@given(RIGID)
def test_the_inverse_undoes(a: Rigid):
    assert is_same(compose(a, inverse(a)), se3(IDENTITY))


@given(RIGID, POINT)
def test_rotating_a_point_is_the_matrix_times_it(a: Rigid, point: tuple[float, float, float]):
    assert np.allclose(rotate(a[1], point), se3(a).rotation @ np.array(point), atol=1e-9)


@given(ANGLE, ANGLE, ANGLE)
def test_roll_pitch_yaw_is_urdfs(roll: float, pitch: float, yaw: float):
    assert np.allclose(
        se3(((0.0, 0.0, 0.0), from_rpy(roll, pitch, yaw))).rotation, pin.rpy.rpyToMatrix(roll, pitch, yaw)
    )


@given(RIGID, RIGID, st.floats(0.0, 1.0))
def test_slerp_turns_at_a_constant_rate_the_short_way(a: Rigid, b: Rigid, share: float):
    whole = float(np.linalg.norm(pin.log3(se3(a).rotation.T @ se3(b).rotation)))
    part = float(np.linalg.norm(pin.log3(se3(a).rotation.T @ se3(((0.0,) * 3, slerp(a[1], b[1], share))).rotation)))
    assert part == pytest.approx(share * whole, abs=1e-5)


def test_slerp_of_opposite_quaternions_stays():
    q = from_axis_angle((0.0, 0.0, 1.0), 1.0)
    assert slerp(q, tuple(-x for x in q), 0.3) == pytest.approx(q)


def test_half_way_is_half_way():
    a, b = IDENTITY, ((1.0, 2.0, 3.0), from_axis_angle((0.0, 0.0, 1.0), 1.0))
    point, turn = interpolate(a, b, 0.5)
    assert point == (0.5, 1.0, 1.5)
    assert turn == pytest.approx(from_axis_angle((0.0, 0.0, 1.0), 0.5))


def test_a_message_comes_back_with_a_unit_quaternion():
    back = from_message(Transform(rotation=(0.0, 0.0, 0.0, 1.0005)))
    assert back[1] == (0.0, 0.0, 0.0, 1.0)
    assert from_message(to_message(back)) == back


@pytest.mark.parametrize("bad", [{"rotation": (0.0, 0.0, 0.0, 2.0)}, {"rotation": ()}, {"translation": (1.0,)}])
def test_a_transform_that_is_none_is_refused(bad: dict[str, tuple[float, ...]]):
    with pytest.raises(ValueError, match=r"quaternion|numbers"):
        from_message(Transform(**bad))
