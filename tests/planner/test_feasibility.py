"""The step stream that the planner foresees is the one that the firmware makes; what the steppers cannot do is said."""

from __future__ import annotations

import dataclasses
import math
import tracemalloc

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import StepMargin
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import PullOut
from gemelo.services.planner.request.refusals import PlanRefused
from gemelo.services.planner.timing.profile import joint_limits, straight_line
from gemelo.services.planner.verification import feasibility
from gemelo.services.planner.verification.feasibility import (
    feasible_scale,
    margins,
    queue_share,
    require_feasible,
    slowed,
    step_stream,
)
from gemelo.services.planner.verification.verify import at_times, states_of
from gemelo.services.stepper_gateway.links.frames import Chunk, ChunkFlag, Heartbeat, encode

FAR = (1.5, -1.2, 0.1)


def line(arm: ArmDescription, goal: tuple[float, ...] = FAR, scaling: float = 1.0) -> JointTrajectory:
    limits = joint_limits(arm, scaling, scaling)
    return straight_line(arm.joint_names, (0.0,) * len(arm.joints), goal, limits)


def with_motor(arm: ArmDescription, index: int, pull_out: PullOut | None) -> ArmDescription:
    joint = arm.joints[index]
    motor = msgspec.structs.replace(joint.drive.motor, pull_out=pull_out)
    drive = msgspec.structs.replace(joint.drive, motor=motor)
    joints = list(arm.joints)
    joints[index] = dataclasses.replace(joint, drive=drive)
    return dataclasses.replace(arm, joints=tuple(joints))


def share_of(found: tuple[StepMargin, ...], name: str) -> StepMargin:
    return next(margin for margin in found if margin.name == name)


@pytest.fixture(scope="module")
def ideal(rm1: ArmDescription) -> ArmDescription:
    """rm1 with motors that never lose a step."""
    arm = rm1
    for index in range(len(rm1.joints)):
        arm = with_motor(arm, index, None)
    return arm


@pytest.mark.parametrize("goal", [FAR, (-0.3, 2.0, 0.19), (0.001, 0.0, 0.0)])
def test_the_stream_is_what_the_firmware_makes(rm1: ArmDescription, goal: tuple[float, ...]) -> None:
    trajectory = line(rm1, goal)
    foreseen = [tuple(row) for row in step_stream(rm1, trajectory).steps.tolist()]
    device = CoreDevice(device_config(rm1), steps=(0, 0, 0))
    device.advance(1_000_000)  # the drivers have their enable lead
    knots = math.ceil(trajectory.points[-1].time_from_start / 0.02)
    times = np.minimum(np.arange(knots + 1) * 0.02, trajectory.points[-1].time_from_start)
    samples = at_times(trajectory, times)
    sent, made = 0, []
    for millisecond in range(1, 1000 * 20):
        if millisecond % 200 == 0:
            device.receive(encode(Heartbeat(boot_id=1, session=1, counter=millisecond)))
        while sent <= knots and sent * 20 < millisecond + 1500:
            send(device, rm1, samples, sent, knots)
            sent += 10
        device.advance(1_000_000 + millisecond * 1000)
        made.append(device.steps)
        if sent > knots and device.steps == foreseen[-1]:
            break
    moved = next(i for i, steps in enumerate(foreseen) if steps != foreseen[0])
    first = next(i for i, steps in enumerate(made) if steps != made[0]) - moved
    last = next(i for i, steps in enumerate(foreseen) if steps == foreseen[-1])
    assert made[first : first + last + 1] == foreseen[: last + 1]


def send(device: CoreDevice, arm: ArmDescription, samples, first: int, knots: int) -> None:
    rows = range(first, min(first + 10, knots + 1))
    scale = [joint.steps.per_unit * 256 for joint in arm.joints]
    positions = tuple(
        tuple(j.steps.to_q8(p) for j, p in zip(arm.joints, samples.positions[row].tolist(), strict=True))
        for row in rows
    )
    velocities = tuple(
        (0,) * len(scale) if row in (0, knots) else tuple(np.rint(samples.velocities[row] * scale).astype(int).tolist())
        for row in rows
    )
    flags = (ChunkFlag.FIRST if first == 0 else 0) | (ChunkFlag.LAST if rows[-1] == knots else 0)
    chunk = Chunk(
        boot_id=1, stream=9, seq=first // 10, expires_us=10**9, dt_us=20_000, flags=flags,
        positions=positions, velocities=velocities,
    )  # fmt: skip
    device.receive(encode(chunk))
    answers = [frame.payload[20] for frame in device.take() if frame.kind == "traj/ack"]
    assert answers == [0]


@given(st.floats(0.05, 1.0))
def test_the_margin_is_the_share_of_the_speed_that_was_asked_for(ideal: ArmDescription, scaling: float) -> None:
    found = require_feasible(ideal, line(ideal, (2.5, 0.0, 0.0), scaling))
    margin = share_of(found, "brazo_joint")
    fastest = max(abs(point.velocities[0]) for point in line(ideal, (2.5, 0.0, 0.0), scaling).points)
    assert margin.share == pytest.approx(fastest / ideal.joints[0].velocity, abs=2e-3)
    assert margin.limited_by == "step rate"
    assert margin.rate_limit == pytest.approx(ideal.joints[0].velocity * 18662.4 / math.tau)


def test_a_motor_too_weak_is_named_and_a_slower_move_offered(ideal: ArmDescription) -> None:
    weak = with_motor(ideal, 0, PullOut(speed=(0.0, 2000.0, 4000.0), torque=(0.5, 0.3, 0.1), inertia=2e-4))
    trajectory = line(weak, (2.5, 0.0, 0.0))
    with pytest.raises(PlanRefused) as refused:
        require_feasible(weak, trajectory)
    assert refused.value.refusal.subject == "brazo_joint"
    assert refused.value.refusal.check == "pull-out torque"
    scale = feasible_scale(weak, trajectory)
    assert 0.0 < scale < 1.0
    assert refused.value.refusal.why == because(
        "plan.steps.torque",
        remedy("slow_down", scale=scale),
        joint="brazo_joint",
        share=refused.value.refusal.value or 0.0,
    )
    require_feasible(weak, slowed(trajectory, scale))
    with pytest.raises(PlanRefused):
        require_feasible(weak, slowed(trajectory, min(1.0, scale * 1.05)))


def test_a_driver_whose_pulses_are_too_wide_is_named(ideal: ArmDescription) -> None:
    joint = ideal.joints[0]
    slow = msgspec.structs.replace(joint.driver, step_high_us=200.0, step_low_us=200.0)
    arm = dataclasses.replace(ideal, joints=(dataclasses.replace(joint, driver=slow), *ideal.joints[1:]))
    with pytest.raises(PlanRefused) as refused:
        require_feasible(arm, line(arm, (2.5, 0.0, 0.0)))
    assert refused.value.refusal.check == "pulse width"


def test_a_queue_too_short_to_brake_in_is_named(ideal: ArmDescription) -> None:
    arm = dataclasses.replace(ideal, device=msgspec.structs.replace(ideal.device, queue_capacity=20))
    trajectory = line(arm, (2.5, 0.0, 0.0))
    assert queue_share(arm, trajectory) > 1.0
    with pytest.raises(PlanRefused) as refused:
        require_feasible(arm, trajectory)
    assert refused.value.refusal.check == "device queue"
    require_feasible(arm, slowed(trajectory, feasible_scale(arm, trajectory)))


def test_slowing_down_keeps_the_way(ideal: ArmDescription) -> None:
    trajectory = line(ideal)
    half = slowed(trajectory, 0.5)
    times = np.linspace(0.0, trajectory.points[-1].time_from_start, 200)
    fast, slow = at_times(trajectory, times), at_times(half, times * 2.0)
    assert np.abs(fast.positions - slow.positions).max() < 1e-12
    assert np.abs(fast.velocities - 2.0 * slow.velocities).max() < 1e-9


def test_what_the_planner_makes_is_feasible_as_it_is(rm1: ArmDescription) -> None:
    found = margins(rm1, step_stream(rm1, line(rm1)))
    assert max(margin.share for margin in found) <= 1.001, found


@pytest.mark.parametrize("most", [7, 60, 10_000])
def test_the_margins_are_the_same_however_many_knots_are_looked_at_at_once(
    rm1: ArmDescription, monkeypatch: pytest.MonkeyPatch, most: int
) -> None:
    trajectory = line(rm1)
    whole = margins(rm1, step_stream(rm1, trajectory))
    monkeypatch.setattr("gemelo.services.planner.verification.feasibility.MOST_KNOTS", most)
    assert require_feasible(rm1, trajectory) == whole


def test_a_plan_of_hours_is_looked_at_in_little_memory(rm1: ArmDescription) -> None:
    tracemalloc.start()
    try:
        found = require_feasible(rm1, line(rm1, scaling=3e-4))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert max(margin.peak_rate / margin.rate_limit for margin in found) < 0.01  # a knot is rounded to 1/256 step
    assert peak < 200e6  # [bytes]


def test_compiled_and_in_python_the_peaks_are_the_same_to_the_bit(rm1: ArmDescription):
    for goal in (FAR, (-0.7, 0.3, 1.0), (0.0, 0.0, 0.0)):
        stream = step_stream(rm1, line(rm1, goal))
        assert np.array_equal(feasibility.peak_rates_in_python(stream), stream.peaks)
        states = states_of(line(rm1, goal))
        knots = len(stream.first)
        for part in ((0, knots), (0, (knots + 1) // 2), (knots // 2, knots)):
            assert feasibility.demands(rm1, states, part) == feasibility.demands_in_python(rm1, states, part), part


@given(st.integers(0, 2**32 - 1))
def test_compiled_and_in_python_a_motor_needs_the_same_torque_to_the_bit(ideal: ArmDescription, seed: int):
    random = np.random.default_rng(seed)
    speed = (0.0, *np.cumsum(random.uniform(1.0, 2000.0, 4)).tolist())
    torque = tuple(sorted(random.uniform(0.0, 0.5, 5).tolist(), reverse=True))
    curve = PullOut(speed=speed, torque=torque, inertia=random.uniform(0.0, 1e-3), friction=random.uniform(0.0, 0.1))
    arm = with_motor(ideal, int(random.integers(3)), curve)
    states = states_of(line(arm, tuple(random.uniform((-2.0, -2.0, 0.0), (2.0, 2.0, 0.2)).tolist())))
    part = (0, math.ceil(float(states.times[-1]) / feasibility.KNOT - 1e-9))
    assert feasibility.demands(arm, states, part) == feasibility.demands_in_python(arm, states, part)


def test_compiled_and_in_python_braking_takes_as_long(rm1: ArmDescription):
    velocities, accelerations = states_of(line(rm1)).velocities, np.array([2.0, 3.0, 0.1])
    compiled = feasibility.longest_braking(velocities, accelerations)
    assert compiled == feasibility.longest_braking_in_python(velocities, accelerations) > 0.0


def test_a_rate_that_is_not_a_number_is_seen_however_many_numbers_come_behind_it():
    start, none = np.ones((5, 2)), np.zeros((5, 2))
    start[1, 0] = np.nan
    rates = feasibility.peak_rates(feasibility.StepStream(*(part[:, None] for part in (none, start, none, none))))
    assert np.isnan(rates[0])
    assert rates[1] == 1.0 / (feasibility.KNOT * feasibility.Q8)
