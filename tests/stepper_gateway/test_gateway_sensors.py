"""Sensors and shafts: republished while fresh, silent with one word, never stale."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gemelo.schemas.topics import DEVICE_SHAFT, SENSORS
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm


def warnings(rig: VirtualArm) -> list[str]:
    return [event for event in rig.events() if event.startswith("sensors")]


def test_readings_that_change_come_ten_times_a_second_with_names_values_and_units() -> None:
    rig = VirtualArm().ready()
    rig.device.set_sensor(0, 12.5)
    rig.device.set_sensor(1, 7.412)
    rig.run(0.5)
    before = len(rig.messages(SENSORS))
    for number in range(30):
        rig.device.set_sensor(0, 12.5 + number % 2)
        rig.run(0.1)
    rig.device.set_sensor(0, 12.5)
    rig.run(0.2)
    assert 29 <= len(rig.messages(SENSORS)) - before <= 33
    last = rig.messages(SENSORS)[-1]
    assert (last.name, last.unit) == (("ultra", "bateria", "pinza"), ("cm", "V", "mm"))
    assert last.value == pytest.approx((12.5, 7.412, 50.0), abs=0.03)
    assert 0 <= rig.moment.unix - last.stamp < 300_000_000
    stamps = [message.stamp for message in rig.messages(SENSORS)[before:]]
    assert all(0 < b - a <= 200_000_000 for a, b in pairwise(stamps))
    assert not warnings(rig)


def test_two_seconds_of_silence_are_said_once_and_end_the_republishing_until_readings_return() -> None:
    rig = VirtualArm().ready()
    rig.device.set_sensor(1, 7.4)
    rig.run(1.0)
    rig.lost.add(Kind.SENSORS)
    rig.run(1.8)
    assert not warnings(rig)
    rig.run(0.5)
    assert warnings(rig) == ["sensors_silent"]
    count = len(rig.messages(SENSORS))
    rig.run(10.0)
    assert len(rig.messages(SENSORS)) == count
    assert warnings(rig) == ["sensors_silent"]
    rig.lost.clear()
    rig.run(0.5)
    assert warnings(rig) == ["sensors_silent", "sensors_back"]
    assert len(rig.messages(SENSORS)) > count


def test_a_device_that_never_reads_its_sensors_is_told_of_once() -> None:
    rig = VirtualArm()
    rig.lost.add(Kind.SENSORS)
    rig.ready()
    rig.run(5.0)
    assert warnings(rig) == ["sensors_silent"]
    assert not rig.messages(SENSORS)


def test_readings_that_robot_toml_does_not_know_are_passed_over() -> None:
    rig = VirtualArm().ready()
    rig.receive(Kind.SENSORS, b'{"t_us": 5, "boot_id": 77, "smell": 3.0, "bateria": 7.0}')
    rig.run(0.2)
    assert all("smell" not in message.name for message in rig.messages(SENSORS))


def test_the_true_shafts_stand_beside_the_counters() -> None:
    rig = VirtualArm().ready()
    rig.device.slip(0, 100)
    rig.receive(Kind.SHAFT, rig.device.shaft_report())
    shaft = rig.messages(DEVICE_SHAFT)[-1]
    assert (shaft.steps, shaft.shaft) == ((0, 0, 0), (100, 0, 0))
    assert shaft.position[0] == pytest.approx(100 / rig.arm.joints[0].steps.per_unit)
    before = rig.core.bad_frames
    rig.receive(Kind.SHAFT, b'{"t_us": 1, "steps": [0], "shaft": [0]}')
    assert rig.core.bad_frames == before + 1
