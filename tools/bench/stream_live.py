"""The lag of streamed targets on a running stack: bus, gateway, broker and virtual device in real time."""

from __future__ import annotations

import time

from gemelo.schemas.joints import JointState, JointTargets
from gemelo.schemas.topics import JOINT_STATES, JOINT_TARGETS
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.leaders import Signal, feasible_sine, person
from gemelo.tools.bench.stack import Running, Stacks

LIVE_GOAL = FigureGoal(median=60.0, p99=120.0)  # [ms]
SECONDS, SETTLED = 10.0, 2.0  # [s] of each leader, and what of it is not measured
RATES = (30.0, 50.0)  # [Hz]
SEED = 3  # of the person
REST = 1.5  # [s] between two leaders, in which the stream before ends
FAST = 0.3  # of the leader's highest speed, below which a lag in time says nothing
H = 1e-3  # [s] over which the leader's speed is taken


def stream_lag_live_ms(stacks: Stacks) -> Figure:
    """Lag [ms] of the first joint behind a leader in this process, by the stamps of the device's states."""
    running = stacks.any_broker()
    joint = running.arm.joints[0]
    leaders = {"person": person(joint, SEED, SECONDS), "0.4 Hz": feasible_sine(joint, 0.4)}
    every: list[float] = []
    reference: dict[str, float] = {}
    for name, signal in leaders.items():
        for rate in RATES:
            lags = followed(running, signal, rate)
            every += lags
            reference[f"{name} {rate:g} Hz median"] = rounded(quantile(lags, 0.5))
            reference[f"{name} {rate:g} Hz p99"] = rounded(quantile(lags, 0.99))
    note = f"{running.arm.name} over MQTT on this machine; a person at 0.8 of the limits, a sine at 0.7"
    return of_samples(every, LIVE_GOAL, reference, note)


def followed(running: Running, signal: Signal, rate: float) -> list[float]:
    """Lags [ms] of every state in fast motion, while `signal` is streamed at `rate` [Hz]."""
    node, joint = running.node, running.arm.joints[0]
    states: list[JointState] = []
    node.subscribe(JOINT_STATES, states.append)
    node.wait(REST)
    if not states:
        raise NotMeasured("nothing of joint_states is received")
    base = dict(zip(states[-1].name, states[-1].position, strict=True))[joint.name]
    targets = node.publisher(JOINT_TARGETS)
    began, start = time.monotonic(), node.now()
    while (elapsed := time.monotonic() - began) < SECONDS:
        stamp = node.now()
        place = base + signal((stamp - start) * 1e-9)
        targets.put(JointTargets(stamp=stamp, name=(joint.name,), position=(place,)))
        node.wait(max(0.0, (int(elapsed * rate) + 1) / rate - (time.monotonic() - began)))
    fastest = max(abs(speed(signal, 0.02 * index)) for index in range(round(SECONDS / 0.02)))
    lags = []
    for state in states:
        t = (state.stamp - start) * 1e-9
        if SETTLED < t < SECONDS and abs(speed(signal, t)) > FAST * fastest:
            behind = base + signal(t) - dict(zip(state.name, state.position, strict=True))[joint.name]
            lags.append(1e3 * behind / speed(signal, t))
    if not lags:
        raise NotMeasured("no state came while the leader was in motion")
    return lags


def speed(signal: Signal, t: float) -> float:
    """[rad/s] or [m/s] of the leader at `t` [s]."""
    return (signal(t + H) - signal(t - H)) / (2.0 * H)
