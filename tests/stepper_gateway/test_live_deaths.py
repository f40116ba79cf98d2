"""A stream that dies at any moment, with or without the heartbeat: the device alone comes to rest within its limits."""

from __future__ import annotations

import random
from functools import cache

import pytest

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.tools.bench.leaders import Sender
from gemelo.tools.bench.scenes import parol6, rm1
from gemelo.tools.bench.stream_lag import middle
from gemelo.tools.virtual_arm.virtual_arm import BOOT_ID, BOOTED, VirtualWire
from tests.stepper_gateway.live import KeptRig, followed, violations

ARMS = {"rm1": rm1, "parol6": parol6}
SECONDS = 4.0  # of a stream
STREAMS = 4
SHARE = 1.4  # of the limits: nobody could follow them
QUICK, FULL = 120, 1000
LONGEST = 2600  # [ms] until it rests
STILL = 120  # [ms] without a motion, that are rest
ROUGH = Sender(30.0, jitter=0.02, loss=0.05, grain=0.0015)
QUICK_ONES = Sender(50.0, jitter=0.02, loss=0.05, grain=0.0015)


@cache
def stream(name: str, number: int, seed: int) -> KeptRig:
    """One of the streams that die."""
    wire = VirtualWire(delay=0.002, jitter=(0.006, 0.03)[number // 2], is_ordered=True)
    return followed(ARMS[name](), 10 * seed + number, SECONDS, wire, (ROUGH, QUICK_ONES)[number % 2], SHARE)


def die(rig: KeptRig, moment: float, beats: bool) -> tuple[CoreDevice, list[tuple[float, ...]]]:
    """A device that is given what that of `rig` was until `moment` [s], and then at most its heartbeats; its path from
    there on [steps]."""
    arm: ArmDescription = rig.arm
    steps = tuple(round(j.steps.to_steps(p)) for j, p in zip(arm.joints, middle(arm), strict=True))
    device = CoreDevice(rig.config, BOOT_ID, BOOTED, steps, True, gripper=arm.gripper)
    cut = BOOTED + round(moment * 1e6)
    for at, kind, payload in rig.given:
        if at >= cut:
            break
        device.advance(at)
        if kind != "config":
            device.receive(payload)
    later = [frame for frame in rig.given if frame[0] >= cut and frame[1] == "hb"] if beats else []
    device.take()
    path: list[tuple[float, ...]] = []
    still = 0
    begin = cut - cut % 1000
    for tick in range(begin + 1000, begin + 1000 * LONGEST, 1000):
        while later and later[0][0] <= tick:
            at, _, payload = later.pop(0)
            device.advance(at)
            device.receive(payload)
        device.advance(tick)
        path.append(device.commanded_steps)
        still = still + 1 if len(path) > 1 and path[-1] == path[-2] else 0
        if still >= STILL:
            break
    assert still >= STILL, f"it moves still after {LONGEST} ms"
    return device, path


def assert_deaths(name: str, count: int, seed: int) -> None:
    chance = random.Random(seed)
    for number in range(count):
        rig = stream(name, number % STREAMS, seed)
        begin = rig.now - SECONDS
        moment, beats = chance.uniform(begin + 0.2, rig.now - 0.1), chance.random() < 0.5
        device, path = die(rig, moment, beats)
        about = f"{name}, stream {number % STREAMS}, {moment:.4f} s, {'with' if beats else 'without'} the heartbeat"
        assert not violations(rig, path), f"{about}: {violations(rig, path)}"
        assert device.max_slot_error <= 128, about


@pytest.mark.parametrize("name", ARMS)
def test_a_stream_that_dies_leaves_the_arm_at_rest_within_its_limits(name: str) -> None:
    assert_deaths(name, QUICK, 1)


@pytest.mark.full
@pytest.mark.parametrize("seed", [2, 3, 4])
@pytest.mark.parametrize("name", ARMS)
def test_3_times_1000_streams_that_die_leave_the_arm_at_rest_within_its_limits(name: str, seed: int) -> None:
    assert_deaths(name, FULL, seed)


@pytest.mark.parametrize("name", ARMS)
def test_streams_that_die_were_followed_within_the_limits(name: str) -> None:
    for number in range(STREAMS):
        rig = stream(name, number, 1)
        assert not violations(rig, rig.path)
        assert rig.device.max_slot_error <= 128
        moved = max(max(column) - min(column) for column in zip(*rig.path, strict=True))
        assert moved > 10.0  # [steps]
