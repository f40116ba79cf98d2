"""The gateway's clock synchronisation with a device whose quartz is off, in virtual time."""

from __future__ import annotations

import pytest

from gemelo.firmware.platform.host.board import DeviceClock
from gemelo.schemas.actions import GoalStatusCode
from gemelo.tools.virtual_arm.virtual_arm import BOOTED, VirtualArm, VirtualWire
from tests.stepper_gateway.harness import move


def drifting_arm(ppm: float, wire: VirtualWire) -> tuple[VirtualArm, DeviceClock]:
    """An arm whose device counts its own microseconds, and the device's clock."""
    clock = DeviceClock(0.0, BOOTED)
    clock.drift(0.0, ppm)
    return VirtualArm(wire, clock=clock), clock


def clock_error(rig: VirtualArm, clock: DeviceClock) -> float:
    """[s] by which the gateway is wrong about the device's clock."""
    believed = rig.core.device.session.clock.device_time(rig.moment.monotonic)
    return (believed - clock.at(rig.now)) * 1e-6


@pytest.mark.parametrize("ppm", [100.0, -100.0])
def test_a_clock_that_is_100_ppm_off_is_known_to_three_milliseconds_all_the_time(ppm: float):
    rig, clock = drifting_arm(ppm, VirtualWire(delay=0.001, jitter=0.004))
    rig.ready()
    errors = []
    for number in range(3):
        there, back = (0.9, 0.4, 0.1), (0.0, 0.0, 0.0)
        start, end = (back, there) if number % 2 == 0 else (there, back)
        assert rig.goal(move(start, end), f"go-{number}").accepted
        rig.run(0.1)
        while f"go-{number}" not in rig.finished:
            rig.run(0.25)
            errors.append(abs(clock_error(rig, clock)))
            assert rig.now < 90.0
        assert rig.finished[f"go-{number}"][0] == GoalStatusCode.SUCCEEDED
    rig.run(20.0)
    assert abs(clock.at(rig.now) - BOOTED - rig.now * 1e6) > 2000  # it has drifted further than that by now
    assert max(errors) < 0.003
    assert abs(clock_error(rig, clock)) < 0.003
    assert rig.device.max_slot_error <= 128


def test_a_clock_is_continuous_when_its_drift_changes():
    clock = DeviceClock(100.0, 7_000)
    assert clock.at(101.0) == 1_007_000
    clock.drift(101.0, 1000.0)
    assert clock.at(101.0) == 1_007_000
    assert clock.at(111.0) == 11_017_000
    clock.restart(111.0)
    assert clock.at(111.0) == 0
    assert clock.at(112.0) == 1_001_000
    assert clock.at(50.0) == 0
