"""Dialect "ra": the virtual sketch against the published law of its library, and what its passes cost a message."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from itertools import accumulate

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.platform.host.sketch import HostSketch
from gemelo.libraries.arm.motors.relative_moves import Loop, Ramp, loop_of, ramp_of
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.message import Vector
from gemelo.schemas.robot import Sketch
from gemelo.services.stepper_gateway.links.foreign.ra_messages import joints_message
from gemelo.tools.bench.ra_remainder import PASSES, driven
from gemelo.tools.virtual_arm.sketch_arm import SketchArm, ra_arm
from tests.profiles import examples
from tests.stepper_gateway.harness import move

RAMPS = tuple(ramp_of(joint.drive) for joint in ra_arm().joints)
FAST = Ramp("q1", RAMPS[0].steps_per_turn, 8000.0, 8000.0)
LOOP = loop_of(ra_arm().device)
STEPS = 1000


def austin_intervals(speed: float, acceleration: float, count: int) -> list[float]:
    """[s] c_1 to c_count of a motor that accelerates, by the published formulas of D. Austin (2005).

    c_0 = 0.676 sqrt(2 / a); c_n = c_(n-1) - 2 c_(n-1) / (4 n + 1); never shorter than 1 / speed.
    """
    first = 0.676 * math.sqrt(2.0 / acceleration)
    ramp = accumulate(range(1, count + 1), lambda c, n: c - 2.0 * c / (4.0 * n + 1.0), initial=first)
    return [max(interval, 1.0 / speed) for interval in list(ramp)[1:]]


def table_of_the_law(ramp: Ramp, pass_time: float) -> list[float]:
    """[s] of the first steps: the first at once, each other in the first pass that begins an interval after it."""
    times = [0.0]
    for interval in austin_intervals(ramp.speed, ramp.acceleration, STEPS - 1):
        times.append(math.ceil((times[-1] + interval) / pass_time - 1e-6) * pass_time)
    return times


def step_times(sketch: HostSketch, count: int) -> list[float]:
    """[s] of the first steps of q1 from here on."""
    times: list[float] = []
    now, motor = 0.0, sketch.motors[0]
    while len(times) < count:
        now += 10e-6
        before = motor.position
        sketch.advance(now)
        if motor.position != before:
            times.append(motor.stepped)
    return times


@pytest.mark.parametrize("ramp", [RAMPS[0], RAMPS[0]._replace(acceleration=3110.0), FAST], ids=["q1", "seed", "fast"])
@pytest.mark.parametrize("pass_time", PASSES)
def test_the_first_thousand_steps_come_when_the_published_law_says(ramp: Ramp, pass_time: float) -> None:
    sketch = HostSketch([ramp], pass_time=pass_time, jitter=0.0, publish=0.0)
    sketch.receive(json.dumps({"q1": 360.0}).encode())
    times = step_times(sketch, STEPS)
    expected = table_of_the_law(ramp, pass_time)
    assert times == pytest.approx([times[0] + time for time in expected], abs=1e-9)


def test_the_law_is_a_constant_acceleration() -> None:
    """The n-th step of an exact ramp is at sqrt(2 n / a): the approximation keeps to that to a third of its first."""
    first = math.sqrt(2.0 / 3110.0)
    for n, time in enumerate(accumulate([0.676 * first, *austin_intervals(1e9, 3110.0, STEPS)]), start=1):
        assert abs(time - first * math.sqrt(n)) < 0.34 * first, n


def test_a_pass_lengthens_the_mean_interval_by_half_of_it() -> None:
    """What a model without passes cannot show: the sketch is slower than its own speed says."""
    sketch = HostSketch([FAST], pass_time=60e-6, publish=0.0)
    sketch.receive(json.dumps({"q1": 360.0}).encode())
    cruising = step_times(sketch, 9000)[5000:]
    mean = (cruising[-1] - cruising[0]) / (len(cruising) - 1)
    assert mean == pytest.approx(1.0 / FAST.speed + 30e-6, abs=6e-6)


@examples(quick=40, full=400)
@given(st.integers(1, 3000), st.floats(50.0, 8000.0), st.floats(50.0, 20000.0), st.floats(20e-6, 250e-6), st.integers())
def test_no_message_takes_longer_than_it_is_given_at_any_pass(
    steps: int, speed: float, acceleration: float, pass_time: float, seed: int
) -> None:
    ramp = Ramp("q1", RAMPS[0].steps_per_turn, speed, acceleration)
    sketch, given_time = HostSketch([ramp], pass_time=pass_time, seed=seed), ramp.duration(steps, LOOP)
    sketch.receive(joints_message((steps,), [ramp], False))
    sketch.advance(given_time + 2.0 * pass_time)
    assert sketch.shafts == (steps,)


@given(st.floats(0.6, 10.0), st.sampled_from([*RAMPS, FAST]), st.sampled_from([0.01, 0.1, 0.5]), st.floats(0.0, 1e-3))
def test_what_a_path_commands_during_a_message_fits_into_the_next(
    message_time: float, ramp: Ramp, telemetry_time: float, pass_time: float
) -> None:
    loop = Loop(pass_time, telemetry_time)
    steps = int(ramp.path_speed(message_time, loop) * message_time)
    assert steps <= 1 or ramp.duration(steps, loop) <= message_time


@examples(quick=12, full=150)
@given(
    st.sampled_from([RAMPS[0], RAMPS[0]._replace(acceleration=3110.0), RAMPS[1], FAST]),
    st.sampled_from([1.0, 2.0, 5.0]),
    st.floats(20e-6, 250e-6),
    st.integers(0, 1 << 20),
)
def test_what_was_sent_is_what_was_made(ramp: Ramp, message_time: float, pass_time: float, seed: int) -> None:
    sketch, sender = driven(ramp, message_time, pass_time, seed)
    assert sketch.discarded == 0
    assert sketch.moves > 2
    assert list(sketch.shafts) == sender.sent == [0]


@pytest.mark.parametrize("pass_time", [150e-6, 250e-6])
def test_a_model_without_passes_would_discard_steps(pass_time: float) -> None:
    """As ours was: a message of 5 s is not over when it believes so."""
    assert driven(FAST, 5.0, pass_time, 1, Loop(0.0, LOOP.telemetry_time))[0].discarded > 100


@pytest.mark.parametrize("pass_time", [20e-6, 150e-6, 250e-6])
def test_a_goal_of_long_messages_arrives_to_the_step_at_every_pass(pass_time: float) -> None:
    """Messages of 5 s and the seed's acceleration: what lost 20 steps and 562 of a message."""
    arm = seeds_arm(message_time=5.0)
    world = SketchArm(arm, pass_time=pass_time).referenced()
    start: Vector = (0.0, 0.0, 0.0)
    for name, end in (("there", (-2.6, 0.5, 0.0)), ("back", start)):
        assert world.goal(move(start, end, arm=arm), name).accepted
        assert world.finish(name)[0] is GoalStatusCode.SUCCEEDED
        assert world.sketch.shafts == world.device.sent
        start = end
    assert world.sketch.discarded == 0


def seeds_arm(message_time: float):
    """rm1 behind the sketch as its code has it: 3110 steps/s^2 for q1."""
    arm = ra_arm(message_time)
    first = arm.joints[0]
    drive = msgspec.structs.replace(first.drive, sketch=Sketch(acceleration=3110.0))
    speed = ramp_of(drive).path_speed(message_time, loop_of(arm.device)) / first.steps.per_unit
    return replace(arm, joints=(replace(first, drive=drive, velocity=min(first.velocity, speed)), *arm.joints[1:]))
