"""The last look at a trajectory finds what must not be executed."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.services.planner.collision.clearance import first_collision
from gemelo.services.planner.core import Planner
from gemelo.services.planner.timing.profile import States, joint_limits, straight_line
from gemelo.services.planner.verification import verify
from gemelo.services.planner.verification.verify import BadTrajectory, require_ends, require_within_limits, sample

START, GOAL = (0.0, 0.0, 0.0), (1.0, -0.5, 0.1)


@pytest.fixture
def trajectory(rm1: ArmDescription) -> JointTrajectory:
    return straight_line(rm1.joint_names, START, GOAL, joint_limits(rm1))


def test_it_samples_what_the_gateway_will_play(trajectory: JointTrajectory):
    samples, sampler = sample(trajectory), TrajectorySampler(trajectory)
    for row in range(0, len(samples.times), 17):
        p, v, a = sampler.at(float(samples.times[row]))
        assert samples.positions[row] == pytest.approx(p, abs=1e-9)
        assert samples.velocities[row] == pytest.approx(v, abs=1e-7)
        assert samples.accelerations[row] == pytest.approx(a, abs=1e-5)


@pytest.mark.parametrize("what", ["velocity", "acceleration"])
def test_a_limit_that_is_exceeded_is_named_with_joint_and_time(
    rm1: ArmDescription, trajectory: JointTrajectory, what: str
):
    tight = msgspec.structs.replace  # the arm's own limits are what a faster trajectory would break
    faster = tight(trajectory, points=tuple(_sped_up(point) for point in trajectory.points))
    with pytest.raises(BadTrajectory, match=r'velocity of "efector_joint" is .* at .* s, .* beyond its limit'):
        require_within_limits(rm1, sample(faster), joint_limits(rm1))
    slow = joint_limits(rm1, 1.0, 0.5) if what == "acceleration" else joint_limits(rm1, 0.5, 1.0)
    with pytest.raises(BadTrajectory, match=what):
        require_within_limits(rm1, sample(trajectory), slow)


def _sped_up(point):
    return msgspec.structs.replace(
        point,
        time_from_start=point.time_from_start / 2,
        velocities=tuple(2 * v for v in point.velocities),
        accelerations=tuple(4 * a for a in point.accelerations),
    )


def test_a_position_beyond_its_limit_is_named(rm1: ArmDescription):
    beyond = straight_line(rm1.joint_names, START, (0.0, 3.0, 0.0), joint_limits(rm1))
    with pytest.raises(BadTrajectory) as refused:
        require_within_limits(rm1, sample(beyond), joint_limits(rm1))
    why = refused.value.reason
    assert (why.code, why.values["joint"], why.values["value"]) == ("plan.verify.limit", "antebrazo_joint", 3.0)
    assert (why.values["quantity"], why.values["unit"]) == ("position", "rad")


def test_compiled_and_in_python_the_samples_are_the_same_to_the_bit_and_jerks_to_rounding(
    trajectory: JointTrajectory, monkeypatch: pytest.MonkeyPatch
):
    compiled = sample(trajectory)
    monkeypatch.setattr(verify, "evaluated", verify.evaluated_in_python)
    python = sample(trajectory)
    for name in ("times", "positions", "velocities", "accelerations"):
        assert np.array_equal(getattr(compiled, name), getattr(python, name)), name
    assert np.allclose(compiled.jerks, python.jerks, rtol=1e-12, atol=0.0)


def test_compiled_and_in_python_a_trajectory_is_seen_to_reach_as_far(trajectory: JointTrajectory):
    states = verify.states_of(trajectory)
    compiled, python = verify.look(states), verify.look_in_python(states)
    assert np.array_equal(compiled.positions, sample(trajectory).positions)
    assert np.array_equal(compiled.reached[:-1], python.reached[:-1])
    assert np.allclose(compiled.reached[-1], python.reached[-1], rtol=1e-12, atol=0.0)
    line = np.array((START, GOAL)) + np.array(((0.0, 1e-3, 0.0), (2e-3, 0.0, 0.0)))
    aside = verify.aside(line, compiled.positions)
    assert aside == pytest.approx(verify.aside_in_python(line, compiled.positions), rel=1e-9)
    assert aside > 1e-4


@pytest.mark.parametrize("seed", range(8))
def test_however_a_trajectory_swings_it_is_seen_to_reach_as_far(seed: int):
    random = np.random.default_rng(seed)
    times = np.cumsum(random.uniform(1e-3, 0.3, 30))
    sizes = (1.0, 10.0 ** random.uniform(-3.0, 1.0), 10.0 ** random.uniform(-3.0, 2.0))
    states = States(times - times[0], *(size * random.normal(size=(30, 5)) for size in sizes))
    compiled, python = verify.look(states), verify.look_in_python(states)
    assert np.array_equal(compiled.reached[:-1], python.reached[:-1])
    assert np.allclose(compiled.reached[-1], python.reached[-1], rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("what", ["positions", "velocities", "accelerations", "times"])
def test_what_is_not_a_number_is_not_within_limits_however_much_comes_behind_it(
    rm1: ArmDescription, trajectory: JointTrajectory, what: str
):
    states = verify.states_of(trajectory)
    odd = getattr(states, what).copy()
    odd[3] = np.nan
    broken = states._replace(**{what: odd})
    with np.errstate(all="ignore"), pytest.raises(BadTrajectory, match="nan"):
        verify.require_limits(rm1, broken, verify.look(broken), joint_limits(rm1), True)


@pytest.mark.parametrize("what", ["position", "velocity", "acceleration", "jerk"])
def test_of_a_quick_look_each_limit_is_told_in_the_same_words(
    rm1: ArmDescription, trajectory: JointTrajectory, what: str
):
    states, limits = verify.states_of(trajectory), joint_limits(rm1)
    verify.require_limits(rm1, states, verify.look(states), limits, True)
    if what == "position":
        beyond = straight_line(rm1.joint_names, START, (0.0, 3.0, 0.0), limits)
        states = verify.states_of(beyond)
    else:
        limits = dataclasses.replace(limits, **{what: 0.9 * getattr(limits, what)})
    with pytest.raises(BadTrajectory, match=f"^{what} of"):
        verify.require_limits(rm1, states, verify.look(states), limits, True)
    if what == "jerk":
        verify.require_limits(rm1, states, verify.look(states), limits, False)


def test_compiled_and_in_python_each_number_beyond_what_it_may_be_is_seen():
    most = np.vstack((-np.ones(3), np.ones((4, 3))))
    assert verify.is_within(most, most)
    assert verify.is_within_in_python(most, most)
    for row, column in np.ndindex(most.shape):
        for wrong in (1.1 * most[row, column], np.nan):
            reached = most.copy()
            reached[row, column] = wrong
            assert not verify.is_within(reached, most)
            assert not verify.is_within_in_python(reached, most)


def test_wrong_ends_are_refused(trajectory: JointTrajectory):
    require_ends(trajectory, START, GOAL)
    with pytest.raises(BadTrajectory, match="from the start to the goal"):
        require_ends(trajectory, START, (1.0, -0.5, 0.100001))
    cut = msgspec.structs.replace(trajectory, points=trajectory.points[:-1])
    with pytest.raises(BadTrajectory, match=r"start to the goal|at rest"):
        require_ends(cut, START, cut.points[-1].positions)


@pytest.mark.parametrize("step", [0.0, -0.01])
def test_a_time_that_stands_or_goes_back_is_refused(rm1: ArmDescription, trajectory: JointTrajectory, step: float):
    """Between two points at the same time a joint could be anywhere, and nothing measured there is a number."""
    points = list(trajectory.points)
    points[3] = msgspec.structs.replace(points[3], time_from_start=points[2].time_from_start + step)
    odd = msgspec.structs.replace(trajectory, points=tuple(points))
    with pytest.raises(BadTrajectory, match="goes from"):
        require_ends(odd, START, GOAL)
    if step == 0.0:
        with np.errstate(all="ignore"), pytest.raises(BadTrajectory, match="nan"):
            require_within_limits(rm1, sample(odd), joint_limits(rm1))


def test_a_touch_in_the_middle_of_a_way_is_found(planner: Planner):
    """Both ends are free; between them the effector would pass through the upper arm."""
    collisions = planner.kinematics.collisions
    rows = np.array([(0.0, 2.6, 0.0), (0.0, 2.9, 0.0), (0.0, 2.6, 0.0)])
    found = first_collision(collisions, rows, 0.004)
    assert found is not None
    assert collisions.distance(found) <= 0.004
    assert first_collision(collisions, rows[:1], 0.004) is None


def test_nothing_that_dense_sampling_sees_is_missed(planner: Planner):
    collisions, generator = planner.kinematics.collisions, np.random.default_rng(5)
    low, high = ([getattr(joint, side) for joint in planner.arm.joints] for side in ("lower", "upper"))
    for _ in range(60):
        ends = generator.uniform(low, high, (2, 3))
        rows = ends[0] + np.linspace(0.0, 1.0, 400)[:, None] * (ends[1] - ends[0])
        is_free = min(collisions.distance(row) for row in rows) > 0.004
        assert (first_collision(collisions, rows, 0.004) is None) <= (min(map(collisions.distance, rows)) > 0.0)
        if is_free:
            assert first_collision(collisions, rows[::40], 0.004 * 0.5) is None
