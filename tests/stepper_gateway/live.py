"""Streams of targets that replace, for tests: a rig that keeps what its device is given, and the limits by the slot."""

from __future__ import annotations

import random

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.tools.bench.leaders import Sender, Signal, lead, person
from gemelo.tools.bench.stream_lag import middle
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire

KNOT = 0.01  # [s] between the near knots
STEADY = 17 / 16  # of a limit: what the device allows a path beyond what it is given, standard: firmware/core


class KeptRig(VirtualArm):
    """Keeps every frame that reaches its device: device time [us], kind and payload."""

    def __init__(self, wire: VirtualWire, arm: ArmDescription, seed: int) -> None:
        self.given: list[tuple[int, str, bytes]] = []
        phase = random.Random(seed).randrange(0, 20_000)
        super().__init__(wire, seed=seed, start=middle(arm), arm=arm, phase_us=phase)

    def _to_device(self, kind: str, payload: bytes) -> None:
        self.given.append((self._device_us, kind, payload))
        super()._to_device(kind, payload)


def persons(arm: ArmDescription, seed: int, seconds: float, share: float = 0.9) -> dict[int, Signal]:
    """A person at every joint, none of them leaving its travel."""
    found: dict[int, Signal] = {}
    for index, (joint, place) in enumerate(zip(arm.joints, middle(arm), strict=True)):
        room = 0.9 * min(joint.upper - place, place - joint.lower)
        wild = person(joint, 31 * seed + index, seconds, share)
        reach = max(abs(wild(0.02 * k)) for k in range(round(50 * seconds)))
        scale = min(1.0, room / reach)
        found[index] = lambda t, wild=wild, scale=scale: scale * wild(t)
    return found


def followed(
    arm: ArmDescription, seed: int, seconds: float, wire: VirtualWire, sender: Sender, share: float = 0.9
) -> KeptRig:
    """A rig whose arm has followed persons at all joints, who use this share of the limits."""
    rig = KeptRig(wire, arm, seed)
    rig.ready().run(0.5)
    rig.path.clear()
    lead(rig, persons(arm, seed, seconds, share), seconds, sender, seed)
    return rig


def violations(rig: VirtualArm, path: list[tuple[float, ...]]) -> list[str]:
    """What of a path of [steps] by the millisecond is beyond what the device was told, rounding of the wire aside."""
    track = np.array(path)
    rates = np.diff(track, axis=0) * 1e3
    bends = np.diff(rates, axis=0) * 1e3
    found = []
    for index, (joint, told) in enumerate(zip(rig.arm.joints, rig.config.joints, strict=True)):
        fastest, sharpest = told.max_velocity_q8 / 256, told.max_acceleration_q8 / 256
        rate, bend = float(np.abs(rates[:, index]).max()), float(np.abs(bends[:, index]).max())
        if rate > fastest + 4 / 256 / KNOT:
            found.append(f"{joint.name}: {rate:.1f} steps/s, limit {fastest:.1f}")
        if bend > STEADY * sharpest + (6 / KNOT**2 + 4 / KNOT) / 256:
            found.append(f"{joint.name}: {bend:.1f} steps/s^2, limit {sharpest:.1f}")
        low, high = track[:, index].min() * 256, track[:, index].max() * 256
        if low < told.lower_q8 - 2 or high > told.upper_q8 + 2:
            found.append(f"{joint.name}: {low:.0f} to {high:.0f} 1/256 steps, {told.lower_q8} to {told.upper_q8}")
    return found


def replacements(rig: VirtualArm) -> int:
    """How many chunks that replace the gateway has sent."""
    return sum(chunk.replaces for chunk in rig.published["commands"])
