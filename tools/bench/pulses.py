"""Figures of the step pulses that the firmware core makes in virtual time: largest rate, timing, silence on e-stop."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from itertools import pairwise

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import PinChange
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import DeviceConfig, InputConfig, InputRole
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples
from gemelo.tools.bench.probe import BOOT, FINE, WireKnot, bench_config, chunk_of, joint_of, play, pulses_of
from gemelo.tools.bench.scenes import parol6, rm1

DT = 0.020  # [s] between knots
TICK_RATES = (50_000, 80_000, 100_000)
RAMP_KNOTS, CRUISE_KNOTS = 10, 15
PULSE_US = 2.5  # [us] high, and low: data sheet of the DM542T
SETUP_US = 5  # [us] DIR before STEP: the same data sheet
GRAIN = 50  # [steps/s] to which the rate is found
HALF_STEP = 128  # [1/256 step]; a larger error is a missing pulse


def max_step_rate_hz() -> Figure:
    """Largest step rate [steps/s] at which every pulse keeps to the path and to the DM542T's data sheet.

    The rate of TICK_HZ 50,000 is given; the references are of all tick rates.
    """
    rates = {tick_hz: largest_rate(tick_hz) for tick_hz in TICK_RATES}
    note = (
        f"virtual time, one joint to and fro, {GRAIN} steps/s exact; the bound is one pulse in two ticks; pulses of "
        f"at least {PULSE_US:g} us high and low, DIR {SETUP_US} us before"
    )
    others = {f"TICK_HZ {tick_hz}": rate for tick_hz, rate in rates.items()}
    first = rates[TICK_RATES[0]]
    return Figure(median=first, p99=first, reference=others, note=note)


def largest_rate(tick_hz: int) -> float:
    """Largest exact rate [steps/s] by bisection; all tried rates below it are exact too."""
    right, wrong = 0, tick_hz // GRAIN + 1  # in GRAIN
    while wrong - right > 1:
        middle = (right + wrong) // 2
        if is_exact(middle * GRAIN, tick_hz):
            right = middle
        else:
            wrong = middle
    return float(right * GRAIN)


def is_exact(rate: int, tick_hz: int) -> bool:
    """True if the device takes a path of `rate` [steps/s] and makes each of its pulses in time."""
    device = CoreDevice(bench_config([joint_of(rate, 1e7, dir_setup_us=SETUP_US)], tick_hz), boot_id=BOOT)
    knots = to_and_fro(rate)
    try:
        changes = play(device, knots, round(DT * 1e6)).changes
    except NotMeasured:
        return False
    pulses = pulses_of(changes, 0)
    moved = sum(abs(b.place - a.place) for a, b in pairwise(pulses))
    is_timed = all((b.tick - a.tick) * 1e6 / tick_hz >= 2 * PULSE_US for a, b in pairwise(pulses))
    is_counted = bool(pulses) and moved == len(pulses) - 1 and device.steps == (0,)
    return is_timed and is_counted and device.max_slot_error <= HALF_STEP


def to_and_fro(rate: int) -> Sequence[WireKnot]:
    """Knots with constant accelerations between 0, `rate` and `-rate` [steps/s], ending where they begin."""
    half = (
        [rate * i / RAMP_KNOTS for i in range(RAMP_KNOTS)]
        + [rate] * CRUISE_KNOTS
        + [rate * i / RAMP_KNOTS for i in range(RAMP_KNOTS, 0, -1)]
    )
    velocities = [*half, *(-v for v in half), 0.0]
    knots, position = [WireKnot((0,), (0,))], 0.0
    for before, after in pairwise(velocities):
        position += (before + after) / 2 * DT
        knots.append(WireKnot((round(position * FINE),), (round(after * FINE),)))
    return knots


ESTOP_GOAL = FigureGoal(p99=1.0)  # [ticks]
PRESSES = 10_000
JOINTS, RATE = 6, 12_000
TICK_HZ = 50_000
TICK_US = 1_000_000 // TICK_HZ
EARLIEST_US, LATEST_US = 20_000, 120_000  # [us] into the move: still speeding up
ESTOP = InputConfig(name="estop", pin=4, role=InputRole.ESTOP)
BEFORE_US, AFTER_US = 200, 2000  # [us] of the trace


def estop_reaction_ticks() -> Figure:
    """Ticks from the one that reads the e-stop as pressed to the last one that still begins a pulse; 0 for none.

    10,000 presses at random ticks of moves of six joints. A pulse that is high when the e-stop is pressed still ends
    one tick later, as the drivers require.
    """
    chance = random.Random(3)
    config = msgspec.structs.replace(
        bench_config([joint_of(RATE, 1e7, inverted=bool(j % 2)) for j in range(JOINTS)], TICK_HZ), inputs=(ESTOP,)
    )
    first = chunk_of([six(knot) for knot in to_and_fro(RATE)], 0, round(DT * 1e6))
    ticks = [reaction(config, first, chance.randrange(EARLIEST_US, LATEST_US)) for _ in range(PRESSES)]
    note = (
        f"virtual time, {PRESSES} presses at random moments, {JOINTS} joints, TICK_HZ {TICK_HZ}, one reading suffices"
    )
    return of_samples(ticks, ESTOP_GOAL, {"most": max(ticks)}, note)


def reaction(config: DeviceConfig, first: bytes, pressed_us: int) -> float:
    """Ticks of one press at `pressed_us` [us] of device time."""
    device = CoreDevice(config, boot_id=BOOT)
    device.receive(first)
    device.advance(pressed_us - BEFORE_US)
    device.trace()
    device.advance(pressed_us)
    device.press_input(0, True)
    device.advance(pressed_us + AFTER_US)
    if device.mode is not DeviceMode.ESTOP or device.armed:
        raise NotMeasured(f"the device is in {device.mode.name} after the e-stop")
    found = -(-pressed_us // TICK_US)  # the first tick that reads it as pressed
    return float(max(0, last_rise(device.take_trace()) - found + 1))


def last_rise(changes: Sequence[PinChange]) -> int:
    """The last tick with a rising edge of STEP; -1 for none."""
    last, high = -1, 0
    for change in changes:
        if change.step & ~high:
            last = change.tick
        high = change.step
    return last


def six(knot: WireKnot) -> WireKnot:
    """The knot of one joint for all six."""
    return WireKnot(knot.position * JOINTS, knot.velocity * JOINTS)


TIME_GOAL = FigureGoal(p99=20.0)  # [us] one tick of rm1
CRUISE = 0.5  # [s]
RAMP_SHARE = 0.9  # of the acceleration limit, at its largest
CROSSING = 1e-7  # [s] to which a crossing is found


def step_time_error_us() -> Figure:
    """Error [us] of every pulse against the time at which the path crosses its half step, at full speed.

    The path is the cubic between the knots as sent; a pulse's time is that of the tick in which STEP rises. One tick
    cannot be avoided; the start and end of a move, where one step takes many slots, weigh most.
    """
    samples: list[float] = []
    largest: dict[str, float] = {}
    for arm in (rm1(), parol6()):
        config, name = device_config(arm), arm.name
        errors = errors_of(config)
        samples += errors
        largest[f"{name} max"] = max(errors)
        largest[f"{name} tick"] = 1e6 / config.tick_hz
    note = f"virtual time, all joints to full speed and back, {len(samples)} pulses, knots every {DT * 1e3:g} ms"
    return of_samples(samples, TIME_GOAL, largest, note)


def errors_of(config: DeviceConfig) -> list[float]:
    """Errors [us] of every pulse of every joint."""
    joints = [joint_of(j.max_velocity_q8 / FINE, j.max_acceleration_q8 / FINE) for j in config.joints]
    knots = full_speed(config)
    changes, origin = play(CoreDevice(bench_config(joints, config.tick_hz), boot_id=BOOT), knots, round(DT * 1e6))
    errors: list[float] = []
    for joint in range(len(joints)):
        times = crossings(knots, joint)
        pulses = pulses_of(changes, joint)
        if len(pulses) != len(times):
            raise NotMeasured(f"joint {joint + 1} makes {len(pulses)} pulses for {len(times)} crossings")
        for pulse, time in zip(pulses, times, strict=True):
            errors.append(abs((pulse.tick + 1) * 1e6 / config.tick_hz - origin - time * 1e6))
    return errors


def full_speed(config: DeviceConfig) -> list[WireKnot]:
    """Knots of a smooth ramp to each joint's full speed, cruising, and a smooth ramp down, all in the same time."""
    speeds = [j.max_velocity_q8 / FINE / 1.02 for j in config.joints]
    slopes = [j.max_acceleration_q8 / FINE for j in config.joints]
    # The cosine ramp v/2 (1 - cos(pi t / T)) has pi v / (2 T) at most.
    ramp = math.ceil(max(math.pi * v / 2 / (RAMP_SHARE * a) for v, a in zip(speeds, slopes, strict=True)) / DT) * DT
    count = round((2 * ramp + CRUISE) / DT)
    return [knot_at(speeds, min(i * DT, 2 * ramp + CRUISE), ramp, i in (0, count)) for i in range(count + 1)]


def knot_at(speeds: Sequence[float], time: float, ramp: float, at_rest: bool) -> WireKnot:
    """The knot at `time` [s] for joints of `speeds` [steps/s]; `ramp` [s] is the duration of each ramp."""

    def travelled(t: float) -> tuple[float, float]:
        """Distance [s at full speed] and speed [share of full speed] at `t` [s], up to the end of the cruise."""
        up = min(t, ramp)
        done = up / 2 - ramp / (2 * math.pi) * math.sin(math.pi * up / ramp)
        return done + max(t - ramp, 0.0), 0.5 - 0.5 * math.cos(math.pi * up / ramp)

    total = 2 * travelled(ramp)[0] + CRUISE
    is_up = time <= ramp + CRUISE
    place, pace = travelled(time) if is_up else travelled(2 * ramp + CRUISE - time)
    share = place if is_up else total - place
    velocity = (0,) * len(speeds) if at_rest else tuple(round(v * pace * FINE) for v in speeds)
    return WireKnot(tuple(round(v * share * FINE) for v in speeds), velocity)


def crossings(knots: Sequence[WireKnot], joint: int) -> list[float]:
    """Path times [s] at which a rising path crosses each half step."""
    times: list[float] = []
    for index, (a, b) in enumerate(pairwise(knots)):
        low = math.floor(a.position[joint] / FINE + 0.5)
        high = math.floor(b.position[joint] / FINE + 0.5)
        times += [index * DT + crossing(a, b, joint, step + 0.5) for step in range(low, high)]
    return times


def crossing(a: WireKnot, b: WireKnot, joint: int, place: float) -> float:
    """Time [s] after knot `a` at which the path reaches `place` [steps], by bisection."""
    early, late = 0.0, DT
    while late - early > CROSSING:
        middle = (early + late) / 2
        if hermite(a, b, joint, middle / DT) < place:
            early = middle
        else:
            late = middle
    return (early + late) / 2


def hermite(a: WireKnot, b: WireKnot, joint: int, u: float) -> float:
    """Position [steps] at the fraction `u` between two knots: the cubic Hermite of firmware/PROTOCOL.md."""
    p, d = a.position[joint] / FINE, (b.position[joint] - a.position[joint]) / FINE
    m0, m1 = a.velocity[joint] / FINE * DT, b.velocity[joint] / FINE * DT
    return p + u * (m0 + u * ((3 * d - 2 * m0 - m1) + u * (m0 + m1 - 2 * d)))
