"""The lag of streamed targets: leader, bus, gateway, wire and device, in virtual time."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.message import Vector
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, rounded
from gemelo.tools.bench.leaders import Sender, Signal, feasible_sine, lead, person, step
from gemelo.tools.bench.scenes import parol6, rm1
from gemelo.tools.virtual_arm.older_arm import OlderArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire

Array = NDArray[np.float64]

LAG_GOAL = FigureGoal(median=45.0)  # [ms]
SECONDS = 10.0
SETTLED = 2.0  # [s] that are not measured
FAST = 0.3  # of the leader's highest speed, below which a lag in time says nothing
SEED = 3  # of the person
STEP = 0.05  # [rad]
BEGUN = 1e-4  # [rad] or [m] of a first motion
MIDDLE = {"rm1": (0.0, 0.0, 0.1), "parol6": (0.0, -1.3, 3.4, 0.0, 0.0, 3.14)}  # [rad] and [m], far from the limits


class Lag(NamedTuple):
    """[ms] by which an arm is behind its leader, and how much wider it swings."""

    median: float
    p99: float
    swing: float  # arm's range / leader's range
    locals: Array  # [ms] (k,) every single one


def stream_lag_ms() -> Figure:
    """Lag [ms] of the first joint behind a leader, both arms at 30 and 50 Hz; beside it the way of a device that cannot
    replace, in the same run."""
    found: list[Array] = []
    reference: dict[str, float] = {}
    for arm in (rm1(), parol6()):
        joint = arm.joints[0]
        moving = {"person": person(joint, SEED, SECONDS), "0.4 Hz": feasible_sine(joint, 0.4)}
        for name, signal in moving.items():
            for rate in (30.0, 50.0):
                lag = lag_of(VirtualArm, arm, signal, Sender(rate))
                found.append(lag.locals)
                reference[f"{arm.name} {name} {rate:g} Hz"] = rounded(lag.median)
            reference[f"{arm.name} {name} 30 Hz, cannot replace"] = rounded(
                lag_of(OlderArm, arm, signal, Sender()).median
            )
        reference[f"{arm.name} first motion of a step"] = first_motion_ms(VirtualArm, arm)
        reference[f"{arm.name} first motion of a step, cannot replace"] = first_motion_ms(OlderArm, arm)
    every = np.concatenate(found)
    median, p99 = float(np.quantile(every, 0.5)), float(np.quantile(every, 0.99))
    worst = max(value for name, value in reference.items() if name.endswith((" 30 Hz", " 50 Hz")))
    return Figure(
        median=rounded(median), p99=rounded(p99), goal=f"{LAG_GOAL} of every leader",
        met=LAG_GOAL.is_met(worst, p99), reference=reference,
        note=f"virtual time, a wire of 1 ms; a person at 0.8 of the limits, a sine at 0.7, a step of {STEP} rad",
    )  # fmt: skip


def lag_of(kind: type[VirtualArm], arm: ArmDescription, signal: Signal, sender: Sender) -> Lag:
    """Of the first joint of `arm`, which follows `signal`."""
    track = tracked(kind, arm, signal, sender, SECONDS)
    times = np.arange(1, len(track) + 1) * 1e-3
    leader = np.array([signal(t) for t in times])
    speed = np.gradient(leader, 1e-3)
    is_fast = (np.abs(speed) > FAST * np.abs(speed).max()) & (times > SETTLED)
    if not is_fast.any():
        raise NotMeasured("the leader does not move")
    lags = 1e3 * (leader - track)[is_fast] / speed[is_fast]
    settled = times > SETTLED
    swing = float(np.ptp(track[settled]) / np.ptp(leader[settled]))
    return Lag(float(np.quantile(lags, 0.5)), float(np.quantile(lags, 0.99)), swing, lags)


def first_motion_ms(kind: type[VirtualArm], arm: ArmDescription) -> float:
    """[ms] from a step of the leader until the first joint has moved by `BEGUN`; raises NotMeasured if it does not."""
    track = tracked(kind, arm, step(STEP), Sender(), 2.0)
    moved = np.flatnonzero(np.abs(track[1000:]) > BEGUN)
    if not moved.size:
        raise NotMeasured("the arm does not follow a step")
    return float(moved[0] + 1)


def tracked(kind: type[VirtualArm], arm: ArmDescription, signal: Signal, sender: Sender, seconds: float) -> Array:
    """(k,) [rad] or [m] of the first joint every millisecond, from where it stood, over `seconds` [s]."""
    rig = kind(VirtualWire(), arm=arm, start=middle(arm)).ready()
    rig.run(0.5)
    rig.path.clear()
    base = lead(rig, {0: signal}, seconds, sender)
    scale = arm.joints[0].steps.per_unit
    return np.array([row[0] / scale for row in rig.path]) - base[0]


def middle(arm: ArmDescription) -> Vector:
    """(n,) [rad] or [m] far from the limits of every joint."""
    known = MIDDLE.get(arm.name)
    return (
        known
        if known is not None
        else tuple(
            0.0 if math.isinf(joint.upper - joint.lower) else 0.5 * (joint.lower + joint.upper) for joint in arm.joints
        )
    )
