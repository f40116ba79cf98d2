"""How far a pulse is from the time at which the path crosses its half step, in moves of rm1 and parol6 at full speed.

Virtual time. The path is the cubic between the knots as they are sent; a pulse's time is that of the tick in which STEP
rises. The step grid is one tick wide, so one tick is what no device can avoid; the start and the end of a move, where
the path takes many slots for a step, weigh most. `p99` is of all pulses; the largest error of each arm stands beside.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from firmware.bindings.device import Device
from schemas.device_config import DeviceConfig
from services.arm.description import load_arm
from services.arm.device_config import device_config
from services.bench.figure import Figure, Goal, NotMeasured, of_samples
from services.bench.pulses import BOOT, FINE, Knot, bench_config, joint_of, play, pulses_of
from services.runtime.deployment import project_root

UNIT = "us"
GOAL = Goal(p99=20.0)  # one tick of rm1
ARMS = ("rm1", "parol6")
DT = 0.020  # [s]
CRUISE = 0.5  # [s]
RAMP_SHARE = 0.9  # of the acceleration limit, at its largest
LATEST = 1e-7  # [s] to which a crossing is found


def measure() -> Figure:
    samples: list[float] = []
    largest: dict[str, float] = {}
    for name in ARMS:
        config = device_config(load_arm(project_root() / Path("urdf", name)))
        errors = errors_of(config)
        samples += errors
        largest[f"{name} max"] = max(errors)
        largest[f"{name} tick"] = 1e6 / config.tick_hz
    note = f"virtual time, all joints to full speed and back, {len(samples)} pulses, knots every {DT * 1e3:g} ms"
    return of_samples(samples, UNIT, GOAL, largest, note)


def errors_of(config: DeviceConfig) -> list[float]:
    """[us] of every pulse of every joint."""
    joints = [joint_of(j.max_velocity_q8 / FINE, j.max_acceleration_q8 / FINE) for j in config.joints]
    knots = full_speed(config)
    changes, origin = play(Device(bench_config(joints, config.tick_hz), boot_id=BOOT), knots, round(DT * 1e6))
    errors: list[float] = []
    for joint in range(len(joints)):
        times = crossings(knots, joint)
        pulses = pulses_of(changes, joint)
        if len(pulses) != len(times):
            raise NotMeasured(f"joint {joint + 1} makes {len(pulses)} pulses for {len(times)} crossings")
        for pulse, time in zip(pulses, times, strict=True):
            errors.append(abs((pulse.tick + 1) * 1e6 / config.tick_hz - origin - time * 1e6))
    return errors


def full_speed(config: DeviceConfig) -> list[Knot]:
    """A smooth ramp to each joint's speed, cruising, and a smooth ramp down; all joints in the same time."""
    speeds = [j.max_velocity_q8 / FINE / 1.02 for j in config.joints]
    slopes = [j.max_acceleration_q8 / FINE for j in config.joints]
    # The cosine ramp v/2 (1 - cos(pi t / T)) has pi v / (2 T) at most.
    ramp = math.ceil(max(math.pi * v / 2 / (RAMP_SHARE * a) for v, a in zip(speeds, slopes, strict=True)) / DT) * DT
    count = round((2 * ramp + CRUISE) / DT)
    return [knot_at(speeds, min(i * DT, 2 * ramp + CRUISE), ramp, i in (0, count)) for i in range(count + 1)]


def knot_at(speeds: Sequence[float], time: float, ramp: float, at_rest: bool) -> Knot:
    def way(t: float) -> tuple[float, float]:
        up = min(t, ramp)
        done = up / 2 - ramp / (2 * math.pi) * math.sin(math.pi * up / ramp)
        return done + max(t - ramp, 0.0), 0.5 - 0.5 * math.cos(math.pi * up / ramp)

    total = 2 * way(ramp)[0] + CRUISE
    is_up = time <= ramp + CRUISE
    place, pace = way(time) if is_up else way(2 * ramp + CRUISE - time)
    share = place if is_up else total - place
    velocity = (0,) * len(speeds) if at_rest else tuple(round(v * pace * FINE) for v in speeds)
    return Knot(tuple(round(v * share * FINE) for v in speeds), velocity)


def crossings(knots: Sequence[Knot], joint: int) -> list[float]:
    """[s] of path time at which a rising path passes each half step."""
    times: list[float] = []
    for index, (a, b) in enumerate(pairwise(knots)):
        low = math.floor(a.position[joint] / FINE + 0.5)
        high = math.floor(b.position[joint] / FINE + 0.5)
        times += [index * DT + crossing(a, b, joint, step + 0.5) for step in range(low, high)]
    return times


def crossing(a: Knot, b: Knot, joint: int, place: float) -> float:
    """[s] after knot `a`, by halving."""
    early, late = 0.0, DT
    while late - early > LATEST:
        middle = (early + late) / 2
        if hermite(a, b, joint, middle / DT) < place:
            early = middle
        else:
            late = middle
    return (early + late) / 2


def hermite(a: Knot, b: Knot, joint: int, u: float) -> float:
    """[steps] as in firmware/PROTOCOL.md."""
    p, d = a.position[joint] / FINE, (b.position[joint] - a.position[joint]) / FINE
    m0, m1 = a.velocity[joint] / FINE * DT, b.velocity[joint] / FINE * DT
    return p + u * (m0 + u * ((3 * d - 2 * m0 - m1) + u * (m0 + m1 - 2 * d)))
