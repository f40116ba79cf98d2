"""A person's actions on a virtual ESP32 over the wire: buttons, faults, a configuration."""

from __future__ import annotations

import json
import signal
import struct
import time
import zlib

import msgspec
from bed_firmware import Bed, wait_for

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind
from gemelo.schemas.device_config import DeviceConfig, config_text

OK = 0


def mode_of(bed: Bed) -> DeviceMode:
    bed.heard.pop("state", None)
    return DeviceMode(bed.answer("state")[16])


def slower(arm: ArmDescription) -> DeviceConfig:
    """rm1's configuration with another heartbeat."""
    return msgspec.structs.replace(device_config(arm), hold_timeout_ms=400)


def test_a_pressed_e_stop_stops_the_device_and_is_told(bed: Bed):
    bed.start_device()
    bed.press(InjectKind.ESTOP)
    assert bed.event("injected")["detail"] == "estop 1"
    assert mode_of(bed) == DeviceMode.ESTOP
    bed.press(InjectKind.ESTOP, value=0.0)
    bed.event("injected")
    wait_for(lambda: bed.order(DeviceCommandKind.RESET) == OK, "the reset")
    assert mode_of(bed) == DeviceMode.UNREFERENCED


def test_a_press_that_cannot_be_is_refused_with_the_reason(bed: Bed):
    bed.start_device()
    bed.press(InjectKind.BLOCK, "q7")
    assert bed.event("inject_refused")["detail"] == "there is no joint 'q7'; there is q1, q2, q3"
    bed.publish("inject", b"\xff\x00{")
    assert "this is no injection" in str(bed.event("inject_refused")["detail"])
    bed.publish("inject", b'{"kind": "dance"}')
    assert "dance" in str(bed.event("inject_refused")["detail"])


def test_a_slip_is_seen_at_the_shaft_and_not_in_the_counter_also_after_a_restart(bed: Bed):
    bed.start_device()
    bed.press(InjectKind.SLIP, "q1", 24.0)
    bed.event("injected")
    report = bed.shaft()
    assert (report["steps"], report["shaft"]) == ([0, 0, 0], [24, 0, 0])
    assert bed.end_device(signal.SIGTERM) == 0
    bed.start_device()
    report = bed.shaft()
    assert (report["steps"], report["shaft"]) == ([0, 0, 0], [24, 0, 0])


def test_a_device_that_is_reset_while_moving_wakes_up_without_its_place_where_it_truly_is(bed: Bed):
    bed.start_device()
    before = bed.status["boot_id"]
    bed.beat()
    assert bed.move(3000, 2.5)[20] == OK
    bed.event("started")
    time.sleep(0.3)
    bed.press(InjectKind.REBOOT)
    wait_for(lambda: bed.status["online"] is True and bed.status["boot_id"] != before, "the next boot")
    assert bed.status["referenced"] is False
    assert bed.status["reset_cause"] == "lost_while_moving"
    report = bed.shaft()
    assert report["steps"] == [0, 0, 0]
    assert 0 < report["shaft"][0] < 3000


def test_an_e_stop_that_is_pressed_stays_pressed_over_a_reset(bed: Bed):
    bed.start_device()
    before = bed.status["boot_id"]
    bed.press(InjectKind.ESTOP)
    bed.event("estop")
    bed.press(InjectKind.REBOOT)
    wait_for(lambda: bed.status["online"] is True and bed.status["boot_id"] != before, "the next boot")
    assert mode_of(bed) == DeviceMode.ESTOP


def test_a_reset_at_rest_forgets_nothing(bed: Bed):
    bed.start_device()
    before = bed.status["boot_id"]
    bed.press(InjectKind.REBOOT)
    wait_for(lambda: bed.status["online"] is True and bed.status["boot_id"] != before, "the next boot")
    assert bed.status["referenced"] is True
    assert bed.status["reset_cause"] == "reset_button"


def test_a_device_without_wifi_holds_by_itself_and_comes_back_as_the_same(bed: Bed):
    bed.start_device()
    before = bed.status["boot_id"]
    bed.beat()
    assert bed.move(4000, 2.5)[20] == OK
    bed.press(InjectKind.OFFLINE, value=2.0)
    assert bed.event("injected")["detail"] == "offline 2"
    wait_for(lambda: bed.status["online"] is False, "the last will")
    wait_for(lambda: bed.status["online"] is True, "the device's return")
    assert bed.status["boot_id"] == before
    assert mode_of(bed) == DeviceMode.HOLD


def test_a_frozen_slot_task_is_a_fault_of_a_moving_device(bed: Bed):
    bed.start_device()
    bed.beat()
    assert bed.move(4000, 2.5)[20] == OK
    bed.event("started")
    bed.press(InjectKind.FREEZE, value=0.3)
    assert bed.event("fault")["detail"] == "no new slot for 3 ms"


def test_a_clock_that_drifts_is_fast_by_as_much(bed: Bed):
    bed.start_device()
    bed.press(InjectKind.DRIFT, value=10_000.0)
    bed.event("injected")

    def device_time() -> float:
        bed.heard.pop("state", None)
        return float(struct.unpack("<Q", bed.answer("state")[8:16])[0]) / 1e6

    device, ours = device_time(), time.monotonic()
    time.sleep(4.0)
    device, ours = device_time() - device, time.monotonic() - ours
    assert 0.002 < device / ours - 1.0 < 0.018  # 1 %, to 32 ms of luck


def test_a_configuration_is_taken_disarmed_and_kept_over_a_restart(bed: Bed, rm1: ArmDescription):
    bed.start_device()
    assert bed.status["config_crc32"] == zlib.crc32(config_text(device_config(rm1)))
    text = config_text(slower(rm1))
    bed.publish("config", text, retain=True)
    refused = json.loads(bed.answer("config/ack"))
    assert refused["accepted"] is False
    assert "disarm" in refused["reason"]
    assert bed.order(DeviceCommandKind.DISARM) == OK
    bed.publish("config", text, retain=True)
    assert json.loads(bed.answer("config/ack"))["accepted"] is True
    wait_for(lambda: bed.status["config_crc32"] == zlib.crc32(text), "the status with the new configuration")
    assert mode_of(bed) == DeviceMode.UNREFERENCED
    assert bed.end_device(signal.SIGTERM) == 0
    bed.publish("config", b"", retain=True)
    bed.start_device()
    assert bed.status["config_crc32"] == zlib.crc32(text)
    assert (bed.folder / "run/virtual_esp32_flash.json").stat().st_mode & 0o077 == 0
