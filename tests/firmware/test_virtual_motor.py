"""The virtual motor: it follows what it has the torque for, and loses whole cycles of the field beyond."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.bindings.motor import MotorError, VirtualMotor
from gemelo.schemas.robot import Motor, PullOut
from tests.profiles import examples

NEMA23 = PullOut(
    speed=(0.0, 1000.0, 2000.0, 4000.0, 6000.0, 8000.0, 10000.0),
    torque=(1.2, 1.15, 1.0, 0.7, 0.45, 0.28, 0.15),
    inertia=7.5e-5,
    friction=0.05,
)
CYCLE = 8  # [pulses] four full steps of a motor with 200, at 400 pulses a turn


def motor(pull_out: PullOut | None = NEMA23, pulses: int = 400) -> Motor:
    return Motor(driver="any", pulses_per_turn=pulses, pull_out=pull_out)


def with_friction(friction: float) -> Motor:
    return motor(PullOut(speed=NEMA23.speed, torque=NEMA23.torque, inertia=NEMA23.inertia, friction=friction))


def turn(motor: VirtualMotor, steps: int, speed: float, acceleration: float, start: float = 0.0) -> float:
    """Steps from rest to rest on a trapezoid; the time [s] at which the motor has settled."""
    ramp = min(speed**2 / (2 * acceleration), abs(steps) / 2)
    top = math.sqrt(2 * acceleration * ramp)
    now = start
    for done in range(abs(steps)):
        here = done + 0.5
        from_rest = math.sqrt(2 * acceleration * min(here, abs(steps) - here))
        now += 1.0 / min(top, from_rest)
        motor.run(now)
        motor.pulse(1 if steps > 0 else -1)
    motor.run(now + 1.0)
    return now + 1.0


def test_a_motor_within_its_torque_makes_every_step():
    bench = VirtualMotor(motor())
    now = turn(bench, 5000, speed=4665.6, acceleration=4665.6)
    assert bench.shaft == 5000
    turn(bench, -5000, speed=4665.6, acceleration=4665.6, start=now)
    assert bench.shaft == 0


def test_an_acceleration_beyond_the_torque_loses_whole_cycles():
    beyond = 1.2 / 7.5e-5 * 400 / math.tau * 2.0  # [steps/s^2] twice what the torque gives at rest
    bench = VirtualMotor(motor())
    turn(bench, 4000, speed=4000.0, acceleration=beyond)
    lost = 4000 - bench.shaft
    assert lost > 0
    assert lost % CYCLE == 0
    within = VirtualMotor(motor())
    turn(within, 4000, speed=4000.0, acceleration=beyond / 4)
    assert within.shaft == 4000


def test_a_speed_beyond_the_curve_stalls_the_motor():
    bench = VirtualMotor(motor())
    turn(bench, 40_000, speed=12_000.0, acceleration=8000.0)
    assert bench.shaft < 20_000


def test_the_torque_at_which_it_pulls_out_is_the_curve_s():
    def follows(friction: float) -> bool:
        bench = VirtualMotor(with_friction(friction))
        turn(bench, 6000, speed=2000.0, acceleration=1000.0)
        return bench.shaft > 6000 - CYCLE / 2  # where friction lets it rest

    assert follows(0.9)  # of the 1.0 N m that the curve has at 2000 steps/s
    assert not follows(1.05)


@pytest.mark.parametrize("speed", [round(20 * 1.3**i) for i in range(15)])
def test_no_speed_within_the_curve_shakes_it_out_of_step(speed: int):
    bench = VirtualMotor(motor())
    turn(bench, 200, speed=float(speed), acceleration=5000.0)
    assert bench.shaft == 200


@examples(quick=10, full=30)
@given(st.lists(st.integers(-300, 300).filter(bool), min_size=1, max_size=8), st.integers(1, 20))
def test_whatever_it_loses_is_whole_cycles(moves: list[int], hardness: int):
    bench, now = VirtualMotor(motor()), 0.0
    for steps in moves:
        now = turn(bench, steps, speed=9000.0, acceleration=20_000.0 * hardness, start=now)
    assert (sum(moves) - bench.shaft) % CYCLE == 0


def test_microsteps_are_followed_to_where_friction_holds_the_rotor():
    curve = PullOut(speed=(0.0, 32000.0), torque=(0.6, 0.3), inertia=2e-5, friction=0.03)
    bench = VirtualMotor(motor(curve, pulses=6400))
    turn(bench, 20_000, speed=32_000.0, acceleration=64_000.0)
    assert abs(bench.shaft - 20_000) <= 2  # asin(0.03 / 0.6) of a cycle of 128 pulses is one


def let_pulses_pass(bench: VirtualMotor, count: int) -> None:
    for i in range(count):
        bench.run(0.01 * (i + 1))
        bench.pulse(1)
    bench.run(1.0)


@pytest.mark.parametrize("make", [motor, lambda: motor(None)], ids=["real", "ideal"])
def test_a_shaft_that_was_held_falls_to_the_nearest_cycle(make: Callable[[], Motor]):
    bench = VirtualMotor(make())
    bench.hold()
    let_pulses_pass(bench, 21)
    assert bench.shaft == 0
    bench.hold(False)
    bench.run(2.0)
    assert bench.shaft == 21 - 3 * CYCLE


def test_a_rotor_that_is_lighter_than_the_tick_can_follow_stays_stable():
    feather = PullOut(speed=(0.0, 10000.0), torque=(2.0, 2.0), inertia=1e-12)
    bench = VirtualMotor(motor(feather))
    turn(bench, 3000, speed=5000.0, acceleration=50_000.0)
    assert bench.shaft == 3000


def test_a_motor_without_torque_stands():
    bench = VirtualMotor(motor(PullOut(speed=(0.0,), torque=(0.0,), inertia=1e-5)))
    turn(bench, 100, speed=100.0, acceleration=100.0)
    assert bench.shaft == 0


def test_a_curve_that_cannot_be_is_refused():
    with pytest.raises(MotorError, match="2 speeds and 1 torques"):
        VirtualMotor(motor(PullOut(speed=(0.0, 1.0), torque=(1.0,), inertia=1e-5)))
