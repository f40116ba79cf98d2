"""Paths, bridges, motions and the path log: continuous, exact at their ends, within limits."""

from __future__ import annotations

import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.device.clock import ClockSync
from gemelo.services.stepper_gateway.goals.limit_checks import within
from gemelo.services.stepper_gateway.motion.commanded_path import CommandedPath
from gemelo.services.stepper_gateway.motion.knot_sources import PathKnots
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits, StepEncoder, StepKnot, whole_steps
from gemelo.services.stepper_gateway.motion.paths import (
    JoinedPath,
    RoundedPath,
    SampledPath,
    StraightLines,
    TimedPath,
    join_path,
    profile,
)
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.profiles import examples
from tests.stepper_gateway.harness import ROOT, move

JOINTS = rm1().joints
LIMITS = Limits.of(JOINTS)
HOME = (0.0, 0.0, 0.0)


def corners(*rows: Vector, spacing: float = 1.0) -> JointTrajectory:
    points = tuple(TrajectoryPoint(positions=row, time_from_start=i * spacing) for i, row in enumerate(rows))
    return JointTrajectory(joint_names=rm1().joint_names, points=points)


def rounded(trajectory: JointTrajectory, start: Vector, offset: float = 0.0) -> RoundedPath:
    lines = StraightLines.of(trajectory)
    while lines.integrate(1):
        pass
    return RoundedPath(lines, start, 0.1, offset)


def derivative(path: TimedPath, t: float, field: int, joint: int, h: float = 1e-5) -> float:
    return (path.at(t + h)[field][joint] - path.at(t - h)[field][joint]) / (2 * h)


@pytest.mark.parametrize("offset", [0.0, 0.55])
def test_a_rounded_path_is_smooth_and_its_rates_are_its_derivatives(offset: float) -> None:
    path = rounded(corners(HOME, (0.5, -0.2, 0.02), (0.3, 0.1, 0.04)), HOME, offset)
    assert path.duration == pytest.approx(2.1 - offset)
    for t in (0.03, 0.2, 0.44, 0.93, 1.017, 1.04):
        for joint in range(3):
            assert derivative(path, t, 0, joint) == pytest.approx(path.at(t).velocity[joint], abs=1e-6)
    if offset == 0.0:
        assert path.at(0.0).position == HOME
        assert path.at(0.0).is_at_rest
    end = path.at(path.duration)
    assert end.position == pytest.approx((0.3, 0.1, 0.04))
    assert end.velocity == pytest.approx(HOME, abs=1e-12)


def test_a_rounded_path_starts_from_the_arm_where_the_first_point_comes_later() -> None:
    points = (TrajectoryPoint(positions=(0.1, 0.1, 0.1), time_from_start=2.0),)
    path = rounded(JointTrajectory(joint_names=rm1().joint_names, points=points), (0.2, 0.2, 0.1))
    assert path.at(0.0).position == pytest.approx((0.2, 0.2, 0.1))
    assert path.at(1.05).position == pytest.approx((0.15, 0.15, 0.1))


places = st.tuples(st.floats(-2.9, 2.9), st.floats(-2.9, 2.9), st.floats(0.0, 0.2))


@examples(quick=15, full=60)
@given(places, places, places, st.floats(0.0, 1.0))
def test_a_bridge_is_continuous_and_keeps_the_limits(
    first: Vector, second: Vector, third: Vector, share: float
) -> None:
    before = profile(Knot.at_rest(first), Knot.at_rest(second), LIMITS)
    assert before is not None
    start = before.at(before.duration * share)
    path = SampledPath(TrajectorySampler(move(start.position, third)))
    joined = join_path(start, path, LIMITS, lambda knot: within(knot, JOINTS))
    assert joined is not None
    assert joined.at(0.0).position == pytest.approx(start.position, abs=1e-9)
    assert joined.at(0.0).velocity == pytest.approx(start.velocity, abs=1e-9)
    assert joined.at(joined.duration).position == pytest.approx(third, abs=1e-6)
    if isinstance(joined, JoinedPath):
        left, right = joined.at(joined.meets - 1e-9), joined.at(joined.meets)
        assert left.position == pytest.approx(right.position, abs=1e-6)
        assert left.velocity == pytest.approx(right.velocity, abs=1e-5)
    for i in range(201):
        knot = joined.at(joined.duration * i / 200)
        assert within(Knot(tuple(round(p, 6) for p in knot.position), HOME, HOME), JOINTS)
        for joint in range(3):
            assert abs(knot.velocity[joint]) <= LIMITS.velocity[joint] * 1.001
            assert abs(knot.acceleration[joint]) <= LIMITS.acceleration[joint] * 1.05


@examples(quick=10, full=40)
@given(st.floats(0.0005, 30.0))
def test_a_planned_motion_has_equal_steps_of_at_most_20_ms_and_ends_exactly(duration: float) -> None:
    points = tuple(
        TrajectoryPoint(positions=(p,) * 3, velocities=HOME, time_from_start=t)
        for p, t in ((0.0, 0.0), (0.1, duration))
    )
    motion = PathKnots(SampledPath(TrajectorySampler(JointTrajectory(points=points))))
    knots: list[Knot] = []
    while not motion.is_finished:
        knots += motion.take(7)
    assert 1000 <= motion.dt_us <= 20_000
    assert len(knots) * motion.dt_us == motion.duration_us
    assert motion.duration_us * 1e-6 == pytest.approx(duration, abs=0.0015)
    assert knots[-1] == Knot.at_rest((0.1,) * 3)


def test_ruckig_is_never_given_intermediate_positions() -> None:
    """They would send the trajectory to a server on the internet."""
    files = [file for folder in ("services", "libraries", "tools", "gemelo") for file in (ROOT / folder).rglob("*.py")]
    assert len(files) > 500
    for file in files:
        assert "intermediate_positions" not in file.read_text(encoding="utf-8"), file


def test_the_path_log_is_the_hermite_that_the_device_plays() -> None:
    log = CommandedPath()
    knot = Knot.at_rest(HOME)
    log.append(0, StepKnot((0, 0, 0), (0, 0, 0)), knot, 0.0)
    log.append(20_000, StepKnot((256, 0, 0), (25600, 0, 0)), knot, 0.0)
    assert log.at(-5).steps == (0.0, 0.0, 0.0)
    assert log.at(20_000).steps == (1.0, 0.0, 0.0)
    assert log.at(10_000).steps[0] == pytest.approx(0.5 - 0.125 * 100 * 0.02)
    assert log.at(10_000).rate[0] == pytest.approx((log.at(10_100).steps[0] - log.at(9_900).steps[0]) / 0.0002)
    assert log.at(99_000).rate == (0.0, 0.0, 0.0)


@given(places)
def test_positions_on_the_wire_are_exact_to_half_a_256th_step(place: Vector) -> None:
    encoded = StepEncoder(JOINTS).encode(Knot.at_rest(place))
    for joint, position, q8 in zip(JOINTS, place, encoded.position, strict=True):
        assert abs(joint.steps.to_steps(position) * 256 - q8) <= 0.5001
        assert abs(whole_steps(q8) - joint.steps.to_steps(position)) <= 0.503


def test_the_clock_trusts_the_shortest_round_trip() -> None:
    clock = ClockSync()
    for sent, way, back in ((0, 300, 9_000), (500_000, 400, 420), (1_000_000, 15_000, 300)):
        device = sent + way + 7_000_000
        clock.add(sent, device, device + 50, sent + way + 50 + back)
    assert clock.is_synchronised
    assert clock.device_time(2.0) == pytest.approx(9_000_000, abs=20)
    assert clock.monotonic(9_000_000) == pytest.approx(2.0, abs=2e-5)
    clock.add(5, 4, 3, 2)
    assert clock.exchanges == 3


def test_the_gateway_needs_neither_the_planner_nor_the_viewer() -> None:
    heavy = "('pinocchio', 'pin', 'coal', 'rerun', 'yourdfpy', 'trimesh')"
    program = (
        f"import sys, gemelo.services.stepper_gateway.main; sys.exit(bool([m for m in {heavy} if m in sys.modules]))"
    )
    assert subprocess.run([sys.executable, "-c", program], cwd=ROOT, check=False).returncode == 0
