"""The invariants that must hold under every fault; pure functions of the messages that were recorded."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceState
from gemelo.schemas.reasons import Reason, because

SLOT = 0.001  # [s] of the device's path: a state may be one older than it says
STEPS = 2.0  # by which two rounded positions may be off
SHORTEST = 0.015  # [s] between two states of which an acceleration is computed
AROUND = 50_000_000  # [ns] between what the device said of a late slot and the states that show it
FREE = 1.3  # an acceleration computed from positions 20 ms apart may be above the limit by this factor

# Codes of a machine without time for gateway and device.
STARVED = frozenset(("ending.held.heartbeat", "device.silent", "answer.goal.silent"))


def is_starved(why: Reason | None) -> bool:
    """True if `why`, or a reason behind it, says that the machine had no time for gateway or device."""
    return why is not None and (why.code in STARVED or any(map(is_starved, why.causes)))


def segments(states: Sequence[DeviceState], late: Sequence[int]) -> list[list[DeviceState]]:
    """The states in pieces within which counters and clock go on: a boot or a reference begins a new one.

    So does each of `late` [ns]: then the machine gave the virtual device no time for so long that its motors stood.
    """
    pieces: list[list[DeviceState]] = []
    for state in states:
        last = pieces[-1][-1] if pieces else None
        is_late = last and any(last.stamp - AROUND <= stamp <= state.stamp + AROUND for stamp in late)
        if last is None or is_late or (last.boot_id, last.referenced) != (state.boot_id, state.referenced):
            pieces.append([])
        elif state.device_time <= last.device_time:
            continue  # said twice
        pieces[-1].append(state)
    return pieces


def jumps(arm: ArmDescription, states: Sequence[DeviceState]) -> list[Reason]:
    """Every place where a joint went farther between two states of one segment than its velocity limit allows."""
    found = []
    for before, after in pairwise(states):
        dt = (after.device_time - before.device_time) * 1e-6
        for joint, old, new in zip(arm.joints, before.steps, after.steps, strict=True):
            allowed = joint.velocity * abs(joint.steps.per_unit) * (dt + SLOT) + STEPS
            if abs(new - old) > allowed:
                found.append(because("chaos.jump", joint=joint.name, steps=new - old, time=dt, allowed=allowed))
    return found


def jerks(arm: ArmDescription, states: Sequence[DeviceState]) -> list[Reason]:
    """Every place where a joint's velocity changed faster over three states than its acceleration limit allows.

    Velocities are differences of counters, so each is off by rounding to steps and by a slot of time; both are taken
    off, and states that are not 15 ms apart or more are left out.
    """
    found = []
    for first, second, third in zip(states, states[1:], states[2:], strict=False):
        one = (second.device_time - first.device_time) * 1e-6
        two = (third.device_time - second.device_time) * 1e-6
        if min(one, two) < SHORTEST:
            continue
        for index, joint in enumerate(arm.joints):
            before = (second.steps[index] - first.steps[index]) / one
            after = (third.steps[index] - second.steps[index]) / two
            unsure = (STEPS + max(abs(before), abs(after)) * SLOT) * (1.0 / one + 1.0 / two)
            allowed = FREE * joint.acceleration * abs(joint.steps.per_unit) * (one + two) / 2.0 + unsure
            if abs(after - before) > allowed:
                found.append(because("chaos.jerk", joint=joint.name, change=after - before, allowed=allowed))
    return found


def moved(arm: ArmDescription, at_rest: Sequence[float], now: Sequence[float]) -> list[Reason]:
    """Every joint that is elsewhere [rad] or [m] than where it rested, by more than rounding."""
    return [
        because("chaos.moved", joint=joint.name, old=old, new=new)
        for joint, old, new in zip(arm.joints, at_rest, now, strict=True)
        if abs(new - old) > STEPS / joint.steps.per_unit
    ]


def misses(arm: ArmDescription, goal: Sequence[float], shaft: Sequence[float]) -> list[Reason]:
    """Every joint whose true shaft [rad] or [m] is not at the goal that was called reached."""
    return [
        because("chaos.missed", joint=joint.name, wanted=wanted, true=true)
        for joint, wanted, true in zip(arm.joints, goal, shaft, strict=True)
        if abs(true - wanted) > STEPS / joint.steps.per_unit
    ]


def missing_records(heard: Sequence[int], recorded: set[int], muted: Sequence[tuple[int, int]]) -> list[int]:
    """Stamps [ns] that were heard and not recorded, outside of the times [ns] in which records may be lost."""
    return [
        stamp for stamp in heard if stamp not in recorded and not any(begin <= stamp <= end for begin, end in muted)
    ]
