"""The gateway's clock synchronisation with a device whose quartz is off, in virtual time."""

from __future__ import annotations

import pytest

from firmware.platform.host.clock import DeviceClock
from schemas.actions import GoalStatusCode
from tests.stepper_gateway.harness import Rig, Wire, move

BOOTED = 5_000_000  # [us] device time at the start


class DriftingRig(Rig):
    """A rig whose device counts its own microseconds."""

    def __init__(self, ppm: float, wire: Wire) -> None:
        self.clock = DeviceClock(0.0, BOOTED)
        self.clock.drift(0.0, ppm)
        super().__init__(wire)

    @property
    def _device_zero(self) -> int:
        return self.now_us - self.clock.at(self.now)

    @_device_zero.setter
    def _device_zero(self, _booted: int) -> None:
        """The clock knows."""

    def clock_error(self) -> float:
        """[s] by which the gateway is wrong about the device's clock."""
        believed = self.core.device.session.clock.device_time(self.moment.monotonic)
        return (believed - self.clock.at(self.now)) * 1e-6


@pytest.mark.parametrize("ppm", [100.0, -100.0])
def test_a_clock_that_is_100_ppm_off_is_known_to_three_milliseconds_all_the_time(ppm: float):
    rig = DriftingRig(ppm, Wire(delay=0.001, jitter=0.004))
    rig.ready()
    errors = []
    for number in range(3):
        there, back = (0.9, 0.4, 0.1), (0.0, 0.0, 0.0)
        start, end = (back, there) if number % 2 == 0 else (there, back)
        assert rig.goal(move(start, end), f"go-{number}").accepted
        rig.run(0.1)
        while f"go-{number}" not in rig.finished:
            rig.run(0.25)
            errors.append(abs(rig.clock_error()))
            assert rig.now < 90.0
        assert rig.finished[f"go-{number}"][0] == GoalStatusCode.SUCCEEDED
    rig.run(20.0)
    assert abs(rig.clock.at(rig.now) - BOOTED - rig.now * 1e6) > 2000  # it has drifted further than that by now
    assert max(errors) < 0.003
    assert abs(rig.clock_error()) < 0.003
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
