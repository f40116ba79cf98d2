"""The stopping distance that is said, against what the device then does, in virtual time."""

from __future__ import annotations

import math

import pytest

from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.ledger import StoppingDistance
from gemelo.schemas.topics import STOPPING_DISTANCE
from gemelo.services.stepper_gateway.motion.stopping import MARGIN, segment, stop_on
from gemelo.tools.bench.figures import quantile
from gemelo.tools.bench.stopping import MOST_CAREFUL, NEAR, lost_in_motion
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

HOLDS = range(5000, 5050)  # seeds


def newest(rig: VirtualArm | SketchArm) -> StoppingDistance:
    rig.run(0.2)
    found: StoppingDistance = rig.messages(STOPPING_DISTANCE)[-1]
    return found


def test_no_stop_is_longer_than_said_and_the_median_is_not_too_careful() -> None:
    found = [lost_in_motion(seed) for seed in HOLDS]
    assert all(hold.said.is_known for hold in found)
    assert all(hold.distance <= hold.said.distance for hold in found)
    assert all(hold.duration <= hold.said.duration for hold in found)
    ratios = [hold.said.distance / hold.distance for hold in found if hold.distance >= NEAR]
    assert len(ratios) > 30
    assert quantile(ratios, 0.5) < MOST_CAREFUL


def test_an_arm_at_rest_goes_nowhere() -> None:
    told = newest(VirtualArm().ready())
    assert (told.is_known, told.distance, told.duration) == (True, 0.0, 0.0)


def test_a_slower_arm_stops_in_less() -> None:
    said = []
    for slower in (1.0, 3.0):
        rig = VirtualArm().ready()
        assert rig.goal(move((0.0, 0.0, 0.0), (1.5, -1.5, 0.1), slower=slower)).accepted
        rig.run(1.2 * slower)
        said.append(newest(rig).distance)
    assert said[1] < 0.5 * said[0]


def test_what_is_not_known_is_said() -> None:
    rig = VirtualArm().ready()
    rig.device_is_on = False
    rig.run(1.0)
    told = newest(rig)
    assert not told.is_known
    assert "silent" in told.reason
    sketch = SketchArm().referenced()
    told = newest(sketch)
    assert not told.is_known
    assert "heartbeat" in told.reason


def test_in_homing_it_is_a_bound_too() -> None:
    rig = VirtualArm(referenced=False, start=(-2.0, -2.0, 0.1)).ready()
    rig.command(DeviceCommandKind.HOME)
    assert rig.run(2.0, lambda: rig.device.mode is DeviceMode.HOMING)
    for moment in (0.5, 8.0, 20.0):
        rig.run(moment)
        told = newest(rig)
        speeds = [abs(rate) for rate in rig.state.velocity]
        reach = sum(rate / joint.steps.per_unit for rate, joint in zip(speeds, rig.arm.joints, strict=True))
        assert told.is_known
        assert told.distance > 0.0
        assert told.duration > 0.4
        assert told.distance < 5.0 * max(reach, 0.3) * told.duration


def test_a_cruise_is_played_until_the_heartbeat_is_missed_and_then_braked_at_the_limit() -> None:
    speed, limit, dt = 0.5, 1.0, 0.02
    path = [segment(dt, speed * dt, (speed,), (speed,))] * 200
    stop = stop_on(path, (limit,), 1.0, 1.0, 0.4, ends=False)
    braking = speed / (MARGIN * limit)
    assert stop.duration == pytest.approx(0.4 + braking, rel=0.01)
    assert stop.distance == pytest.approx(speed * 0.4 + 0.5 * speed * braking, rel=0.02)


def test_a_path_that_ends_before_is_played_to_its_end() -> None:
    path = [segment(0.02, 0.01, (0.5 * math.sin(0.3 * i),), (0.5 * math.sin(0.3 * i + 0.3),)) for i in range(5)]
    stop = stop_on(path, (100.0,), 1.0, 1.0, 10.0, ends=True)
    assert stop.distance == pytest.approx(0.05, rel=0.03)
    assert stop.duration == pytest.approx(0.1, rel=0.01)
    assert stop_on([], (1.0,), 1.0, 1.0, 0.4, ends=True).distance == 0.0
