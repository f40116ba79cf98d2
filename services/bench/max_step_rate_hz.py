"""The largest step rate at which every pulse comes out, with the driver's timing, through the real core.

Virtual time: a joint speeds up, cruises and stops at every rate that is tried, while a trace of its pins is held
against the path (exact counts at every slot's end) and against the DM542T's data sheet. `median` is of TICK_HZ 50,000.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from firmware.bindings.device import Device
from services.bench.figure import Figure, NotMeasured
from services.bench.pulses import BOOT, FINE, Knot, bench_config, joint_of, play, pulses_of

UNIT = "steps/s"
TICK_HZ = (50_000, 80_000, 100_000)
DT = 0.020  # [s]
RAMP, CRUISE = 10, 15  # knots
PULSE_US = 2.5  # high, and low: DM542T
SETUP_US = 5  # DIR before STEP
GRAIN = 50  # [steps/s] to which the rate is found
HALF_STEP = 128  # 1/256 step: more is a pulse that is missing


def measure() -> Figure:
    rates = {tick_hz: largest_rate(tick_hz) for tick_hz in TICK_HZ}
    note = (
        f"virtual time, one joint to and fro, {GRAIN} steps/s exact; the bound is one pulse in two ticks; pulses of "
        f"at least {PULSE_US:g} us high and low, DIR {SETUP_US} us before"
    )
    others = {f"TICK_HZ {tick_hz}": rate for tick_hz, rate in rates.items()}
    first = rates[TICK_HZ[0]]
    return Figure(unit=UNIT, median=first, p99=first, reference=others, note=note)


def largest_rate(tick_hz: int) -> float:
    """By halving: every rate up to it is right, as far as was tried."""
    right, wrong = 0, tick_hz // GRAIN + 1  # in GRAIN
    while wrong - right > 1:
        middle = (right + wrong) // 2
        if is_exact(middle * GRAIN, tick_hz):
            right = middle
        else:
            wrong = middle
    return float(right * GRAIN)


def is_exact(rate: int, tick_hz: int) -> bool:
    """Whether the device takes such a path and makes each of its pulses in time."""
    device = Device(bench_config([joint_of(rate, 1e7, dir_setup_us=SETUP_US)], tick_hz), boot_id=BOOT)
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


def to_and_fro(rate: int) -> Sequence[Knot]:
    """Constant accelerations between 0, `rate`, and `-rate`; ends where it began."""
    half = [rate * i / RAMP for i in range(RAMP)] + [rate] * CRUISE + [rate * i / RAMP for i in range(RAMP, 0, -1)]
    velocities = [*half, *(-v for v in half), 0.0]
    knots, position = [Knot((0,), (0,))], 0.0
    for before, after in pairwise(velocities):
        position += (before + after) / 2 * DT
        knots.append(Knot((round(position * FINE),), (round(after * FINE),)))
    return knots
