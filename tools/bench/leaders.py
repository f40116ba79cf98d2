"""The leaders of a streamed arm: signals of one joint over time, and targets made of them as a sender makes them."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Vector
from gemelo.tools.virtual_arm.gateway_driver import TargetsInput
from gemelo.tools.virtual_arm.virtual_arm import UNIX, VirtualArm

Signal = Callable[[float], float]  # displacement [rad] or [m] at a time [s]

SHARE = 0.8  # of the joint's limits, that a person's signal uses
FINE = 1000  # [1/s] samples of a person's signal
FADED = 1.5  # [s] in which it fades in
BUS = 0.001  # [s] from the sender to the gateway


class Sender(NamedTuple):
    """How targets are sent: `rate` [Hz]; `jitter` [s] that they come late at most, `loss` the share that never comes,
    `grain` [rad] or [m] by which the leader is coarse; `stamped`: with the time of sending."""

    rate: float = 30.0
    jitter: float = 0.0
    loss: float = 0.0
    grain: float = 0.0
    stamped: bool = True


def step(size: float, at: float = 1.0) -> Signal:
    """From 0 to `size` [rad] or [m] at `at` [s]."""
    return lambda t: size if t >= at else 0.0


def sine(frequency: float, size: float) -> Signal:
    """Of that `frequency` [Hz] and amplitude [rad] or [m], faded in over two seconds."""

    def at(t: float) -> float:
        faded = min(1.0, 0.5 * t)
        return size * math.sin(math.tau * frequency * t) * faded * faded * (3.0 - 2.0 * faded)

    return at


def feasible_sine(joint: Joint, frequency: float) -> Signal:
    """As wide as 0.7 of the joint's acceleration and 0.75 of its velocity allow at `frequency` [Hz]."""
    rate = math.tau * frequency
    return sine(frequency, min(0.7 * joint.acceleration / rate**2, 0.75 * joint.velocity / rate))


def person(joint: Joint, seed: int, seconds: float, share: float = SHARE) -> Signal:
    """Six sines of 0.1 to 0.9 Hz with four pauses over `seconds` [s], at `share` of the joint's velocity or
    acceleration, whichever comes first."""
    chance = random.Random(seed)
    parts = [(chance.uniform(0.1, 0.9), chance.uniform(0.3, 1.0), chance.uniform(0.0, math.tau)) for _ in range(6)]
    pauses = [(chance.uniform(1.0, max(1.5, seconds - 2.0)), chance.uniform(0.5, 1.2)) for _ in range(4)]
    times = np.arange(round((seconds + 1.0) * FINE) + 1) / FINE
    pace = np.ones_like(times)
    for begin, length in pauses:
        away = np.abs((times - begin) / length - 0.5) - 0.5  # outside the pause, in its lengths
        pace *= np.where(away <= 0.0, 0.0, np.where(away < 0.5, 0.5 - 0.5 * np.cos(math.tau * away), 1.0))
    warped = np.concatenate(([0.0], np.cumsum(pace)[:-1])) / FINE
    places = np.zeros_like(times)
    for frequency, size, phase in parts:
        places += size / frequency * np.sin(math.tau * frequency * warped + phase)
    faded = np.minimum(1.0, times / FADED)
    places = (places - places[0]) * faded * faded * (3.0 - 2.0 * faded)
    rates = np.gradient(places, 1.0 / FINE)
    fastest, sharpest = np.abs(rates).max(), np.abs(np.gradient(rates, 1.0 / FINE)).max()
    places *= share * min(joint.velocity / fastest, joint.acceleration / sharpest)
    last = len(times) - 1
    return lambda t: float(places[max(0, min(last, round(t * FINE)))])


def lead(rig: VirtualArm, signals: dict[int, Signal], seconds: float, sender: Sender, seed: int = 1) -> Vector:
    """Streams the signals by joint to `rig` for `seconds` [s]; (n,) [rad] or [m] from where they count."""
    chance, base, began = random.Random(seed), rig.position, rig.now
    arrivals = []
    for index in range(round(seconds * sender.rate)):
        late = BUS + chance.random() * sender.jitter
        if chance.random() >= sender.loss:
            arrivals.append((index / sender.rate + late, index / sender.rate))
    for arrival, sent in sorted(arrivals):
        rig.run(max(0.0, began + arrival - rig.now))
        rig.handle(TargetsInput(target(rig, base, signals, sent, began, sender)))
    rig.run(max(0.0, began + seconds - rig.now))
    return base


def target(
    rig: VirtualArm, base: Vector, signals: dict[int, Signal], sent: float, began: float, sender: Sender
) -> JointTargets:
    """What is sent `sent` [s] after `began` [s]: the signals from `base` [rad] or [m] on, within the joints' limits."""
    places = [place + signals[index](sent) if index in signals else place for index, place in enumerate(base)]
    if sender.grain:
        places = [round(place / sender.grain) * sender.grain for place in places]
    within = tuple(max(j.lower, min(place, j.upper)) for j, place in zip(rig.arm.joints, places, strict=True))
    stamp = UNIX + round((began + sent) * 1e9) if sender.stamped else 0
    return JointTargets(stamp=stamp, name=rig.arm.joint_names, position=within)
