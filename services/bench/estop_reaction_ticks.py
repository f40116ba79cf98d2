"""Ticks from the one that finds the e-stop pressed to the last one that still begins a pulse: 0 is silence at once.

Virtual time, the real core: 10,000 presses at random ticks of moves of six joints. A pulse that is high when the e-stop
comes still ends one tick later, as the drivers ask.
"""

from __future__ import annotations

import random
from collections.abc import Sequence

import msgspec

from firmware.bindings.device import Device
from firmware.bindings.words import PinChange
from schemas.device import DeviceMode
from schemas.device_config import DeviceConfig, InputConfig, InputRole
from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.max_step_rate_hz import to_and_fro
from services.bench.pulses import BOOT, Knot, bench_config, chunk_of, joint_of

UNIT = "ticks"
GOAL = Goal(p99=1.0)
PRESSES = 10_000
JOINTS, RATE = 6, 12_000
TICK_HZ = 50_000
TICK_US = 1_000_000 // TICK_HZ
DT_US = 20_000
EARLIEST, LATEST = 20_000, 120_000  # [us] into the move: still speeding up
ESTOP = InputConfig(name="estop", pin=4, role=InputRole.ESTOP)
BEFORE_US, AFTER_US = 200, 2000  # of the trace


def measure() -> Figure:
    chance = random.Random(3)
    config = msgspec.structs.replace(
        bench_config([joint_of(RATE, 1e7, inverted=bool(j % 2)) for j in range(JOINTS)], TICK_HZ), inputs=(ESTOP,)
    )
    first = chunk_of([six(knot) for knot in to_and_fro(RATE)], 0, DT_US)
    ticks = [reaction(config, first, chance.randrange(EARLIEST, LATEST)) for _ in range(PRESSES)]
    note = (
        f"virtual time, {PRESSES} presses at random moments, {JOINTS} joints, TICK_HZ {TICK_HZ}, one reading suffices"
    )
    return of_samples(ticks, UNIT, GOAL, {"most": max(ticks)}, note)


def reaction(config: DeviceConfig, first: bytes, pressed_us: int) -> float:
    """Of one press."""
    device = Device(config, boot_id=BOOT)
    device.receive(first)
    device.advance(pressed_us - BEFORE_US)
    device.trace()
    device.advance(pressed_us)
    device.press_input(0, True)
    device.advance(pressed_us + AFTER_US)
    if device.mode is not DeviceMode.ESTOP or device.armed:
        raise NotMeasured(f"the device is in {device.mode.name} after the e-stop")
    found = -(-pressed_us // TICK_US)  # the first tick that finds it pressed
    return float(max(0, last_rise(device.take_trace()) - found + 1))


def last_rise(changes: Sequence[PinChange]) -> int:
    """The last tick in which a STEP rises; -1 for none."""
    last, high = -1, 0
    for change in changes:
        if change.step & ~high:
            last = change.tick
        high = change.step
    return last


def six(knot: Knot) -> Knot:
    return Knot(knot.position * JOINTS, knot.velocity * JOINTS)
