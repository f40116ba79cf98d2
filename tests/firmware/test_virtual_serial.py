"""The virtual ESP32 on a serial line: frames, configuration, provisioning, and two wires at once."""

from __future__ import annotations

import json
import signal
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import msgspec
import pytest
from bed_firmware import Bed, SerialPort, wait_for
from bench_firmware import BOOT, FIRST, LAST, command, heartbeat, seal, smooth, traj

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, json_frame, packet, parse_json_frame
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind
from gemelo.schemas.device_config import DeviceConfig, config_text

ACK, CMD_ACK, SYNC_R, STATE = 2, 4, 7, 8
OK = 0
SECRET = "correct horse battery staple"


def sync(t0: int) -> bytes:
    return seal(struct.pack("<BBBBIQ", 0x67, 1, 6, 0, 0, t0))


def kinds(data: bytes) -> set[int]:
    return {frame[2] for frame in PacketDecoder().feed(data)}


def other(arm: ArmDescription) -> DeviceConfig:
    return msgspec.structs.replace(device_config(arm), hold_timeout_ms=400)


def test_an_answer_goes_where_the_question_came_from_and_states_where_the_heartbeat_was(rm1: ArmDescription):
    device = CoreDevice(device_config(rm1), boot_id=BOOT)
    device.attach_line()
    device.receive_serial(packet(heartbeat(1)))
    device.advance(100_000)
    device.take()
    assert STATE in kinds(device.take_serial())
    device.receive_serial(packet(sync(5)))
    assert kinds(device.take_serial()) == {SYNC_R}
    assert device.take() == []
    device.receive(sync(6))
    assert [frame.kind for frame in device.take()] == ["sync/r"]
    assert device.take_serial() == b""
    device.advance(300_000)
    assert {frame.kind for frame in device.take()} == set()
    device.receive(heartbeat(2))
    device.take_serial()
    device.advance(600_000)
    assert "state" in {frame.kind for frame in device.take()}
    assert STATE not in kinds(device.take_serial())


def test_a_move_over_the_line_arrives_to_the_step(rm1: ArmDescription):
    device = CoreDevice(device_config(rm1), boot_id=BOOT)
    device.attach_line()
    device.advance(300_000)
    points = [smooth(0, 1000, 2.0, i * 0.02) for i in range(101)]
    rows = [([round(p * 256), 0, 0], [round(v * 256), 0, 0]) for p, v in points]
    wire = b"\x00garbage" + packet(heartbeat(1)) + packet(traj(1, 0, rows, FIRST | LAST))
    for i in range(0, len(wire), 7):  # as bytes trickle in
        device.receive_serial(wire[i : i + 7])
    answers = [frame for frame in PacketDecoder().feed(device.take_serial()) if frame[2] == ACK]
    assert [frame[20] for frame in answers] == [OK]
    for beat in range(2, 14):
        device.advance(device.now_us + 200_000)
        device.receive_serial(packet(heartbeat(beat)))
    assert device.steps == device.shaft == (1000, 0, 0)
    assert device.mode == DeviceMode.IDLE


def test_a_line_of_text_moves_the_joints_and_is_acknowledged(rm1: ArmDescription):
    device = CoreDevice(device_config(rm1), boot_id=BOOT)
    device.attach_line()
    device.advance(300_000)
    device.take_serial()
    for seq in range(1, 30):
        device.receive_serial(b"<%d,0.05,0,0>\n" % seq)
        device.advance(device.now_us + 100_000)
    assert device.take_serial().count(b"<ACK,") == 29
    joint = rm1.joints[0]
    assert device.steps[0] == pytest.approx(joint.steps.to_steps(0.05), abs=1)


def test_a_configuration_over_the_line_is_taken_by_a_device_that_has_none(rm1: ArmDescription):
    device = CoreDevice(None, boot_id=BOOT)
    device.attach_line()
    device.advance(50_000)
    assert device.mode == DeviceMode.BOOT
    text = config_text(device_config(rm1))
    device.receive_serial(packet(json_frame(JsonFrame.CONFIG, text)))
    device.advance(100_000)
    answers = [parse_json_frame(frame) for frame in PacketDecoder().feed(device.take_serial())]
    acks = [json.loads(found.text) for found in answers if found is not None and found.kind == JsonFrame.CONFIG_ACK]
    assert [ack["accepted"] for ack in acks] == [True]
    assert device.mode == DeviceMode.UNREFERENCED
    assert device.config == device_config(rm1)
    assert device.kept_config == text
    assert device.steps == (0, 0, 0)


@pytest.fixture
def line(bed: Bed) -> Iterator[SerialPort]:
    bed.start_device("--serial")
    with closing(SerialPort(bed.folder / "run/virtual_esp32.tty")) as port:
        yield port


def test_both_wires_live_at_once(bed: Bed, line: SerialPort):
    line.send(sync(77))
    assert struct.unpack("<Q", line.answer(SYNC_R)[8:16]) == (77,)
    bed.publish("sync", sync(78))
    assert struct.unpack("<Q", bed.answer("sync/r")[8:16]) == (78,)
    line.send_json(JsonFrame.INJECT, {"kind": InjectKind.SLIP, "target": "q1", "value": 16.0})
    assert line.json(JsonFrame.EVENT)["event"] == "injected"
    assert bed.event("injected")["detail"] == "slip q1 16"
    assert bed.end_device(signal.SIGTERM) == 0
    assert not (bed.folder / "run/virtual_esp32.tty").is_symlink()


def test_a_stranger_on_the_line_is_told_who_is_there(bed: Bed, line: SerialPort):
    line.send(heartbeat(1))
    status = line.json(JsonFrame.STATUS)
    assert status["device"] == "rm1"
    assert status["virtual"] is True
    assert line.json(JsonFrame.SHAFT)["shaft"] == [0, 0, 0]


def test_credentials_are_kept_in_its_flash_count_from_the_next_boot_on_and_are_said_nowhere(bed: Bed, line: SerialPort):
    before = bed.status["boot_id"]
    line.send_json(
        JsonFrame.PROVISION,
        {
            "wifi_ssid": "lab",
            "wifi_password": SECRET,
            "mqtt_uri": f"mqtt://127.0.0.1:{bed.port}",
            "mqtt_password": SECRET,
        },
    )
    answer = line.json(JsonFrame.PROVISION_ACK)
    assert answer == {"accepted": True, "reason": ""}
    wait_for(lambda: bed.status["online"] is True and bed.status["boot_id"] != before, "the next boot")
    assert bed.status["reset_cause"] == "provisioned"
    assert bed.status["referenced"] is True
    flash = bed.folder / "run/virtual_esp32_flash.json"
    assert json.loads(flash.read_text())["credentials"]["wifi_password"] == SECRET
    assert flash.stat().st_mode & 0o077 == 0
    assert bed.end_device(signal.SIGTERM) == 0
    assert SECRET not in bed.log
    others = [path for path in (bed.folder / "run").iterdir() if path != flash and path.is_file()]
    assert not [path for path in others if SECRET in path.read_text(errors="replace")]


@pytest.mark.parametrize(
    "said",
    [
        {"wifi_password": "short"},
        {"mqtt_uri": "http://somewhere"},
        {"wifi_ssid": 7},
        {"wifi_passwort": SECRET},
        b"\xff\xfe{",
    ],
)
def test_credentials_that_cannot_be_are_refused_without_saying_them_again(
    bed: Bed, line: SerialPort, said: dict[str, object] | bytes
):
    before = bed.status["boot_id"]
    line.send_json(JsonFrame.PROVISION, said)
    answer = line.json(JsonFrame.PROVISION_ACK)
    assert answer["accepted"] is False
    assert answer["reason"]
    assert SECRET not in str(answer)
    assert "short" not in str(answer["reason"]).replace("shorter", "")
    assert bed.status["boot_id"] == before
    assert not (bed.folder / "run/virtual_esp32_flash.json").exists()


def test_a_factory_reset_forgets_all_and_a_configuration_brings_it_back(
    bed: Bed, line: SerialPort, rm1: ArmDescription
):
    text = config_text(other(rm1))
    line.send_json(JsonFrame.PROVISION, {"factory_reset": True})
    assert line.json(JsonFrame.PROVISION_ACK)["accepted"] is True
    wait_for(lambda: bed.status.get("joints") == 0, "a device without a configuration")
    assert bed.status["reset_cause"] == "factory_reset"
    line.send_json(JsonFrame.CONFIG, text)
    assert line.json(JsonFrame.CONFIG_ACK)["accepted"] is True
    wait_for(lambda: bed.status["config_crc32"] == zlib.crc32(text), "the status with its configuration")
    assert bed.status["referenced"] is False
    boot = bed.status["boot_id"]
    assert isinstance(boot, int)
    line.send(command(DeviceCommandKind.ARM, 1, boot=boot))
    assert line.answer(CMD_ACK)[13] == OK


def test_a_device_is_not_provisioned_while_it_moves(bed: Bed, line: SerialPort):
    bed.beat()
    assert bed.move(2000, 2.0)[20] == OK
    line.send_json(JsonFrame.PROVISION, {"factory_reset": True})
    answer = line.json(JsonFrame.PROVISION_ACK)
    assert answer == {"accepted": False, "reason": "the device moves: stop it first"}


def test_a_stale_link_is_replaced_and_the_line_works_without_anybody_on_it(bed: Bed, tmp_path: Path):
    path = bed.folder / "run/virtual_esp32.tty"
    path.parent.mkdir()
    path.symlink_to(tmp_path / "gone")
    bed.start_device("--serial")
    bed.beat()
    assert bed.move(100, 0.4)[20] == OK
    bed.event("finished")
    assert path.readlink().exists()
