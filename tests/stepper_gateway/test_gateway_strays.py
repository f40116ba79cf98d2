"""Stray, replayed and lost messages between gateway and device: none of them blocks the arm."""

from __future__ import annotations

import msgspec
import pytest
from msgspec.structs import replace

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.runtime.serial_frames import packet
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_STATUS, JOINT_STATES
from gemelo.services.stepper_gateway.links.frames import (
    Ack,
    Code,
    CommandFrame,
    CommandReply,
    Heartbeat,
    StateFrame,
    Sync,
    decode,
    encode,
)
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)
STATUS = 11
NEVER = 2**63  # [us]


def moving_rig() -> VirtualArm:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    return rig


def last_beat(rig: VirtualArm) -> Heartbeat:
    beat = decode(next(payload for _, kind, payload in reversed(rig.sent) if kind == Kind.HB))
    assert isinstance(beat, Heartbeat)
    return beat


def commands(rig: VirtualArm) -> list[CommandFrame]:
    frames = [decode(payload) for _, kind, payload in rig.sent if kind == Kind.CMD]
    return [frame for frame in frames if isinstance(frame, CommandFrame)]


def test_a_replayed_heartbeat_from_far_ahead_holds_nothing() -> None:
    rig = moving_rig()
    beat = last_beat(rig)
    rig.device.receive(encode(replace(beat, counter=beat.counter + 2**24)))
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert "hold" not in rig.events()


@pytest.mark.parametrize("fields", [{"next_seq": 2**31}, {"seq": 2**31}, {"seq": 2**31, "next_seq": 2**31}])
@pytest.mark.parametrize("code", [Code.OK, Code.GAP, Code.VELOCITY_LIMIT])
def test_an_answer_to_a_chunk_that_was_never_sent_is_counted_and_stalls_nothing(
    code: Code, fields: dict[str, int]
) -> None:
    rig = moving_rig()
    stream = rig.core.controller.stream
    assert stream is not None
    forged = Ack(boot_id=stream.boot_id, stream=stream.id, seq=stream.next_seq - 1, next_seq=stream.next_seq, code=code)
    before = rig.core.bad_frames
    rig.receive(Kind.TRAJ_ACK, encode(replace(forged, **fields)))
    status, result = rig.finish()
    assert status == GoalStatusCode.SUCCEEDED, result.error_string
    assert rig.core.bad_frames == before + 1


def test_a_device_that_misses_heartbeats_which_are_sent_gets_a_fresh_session() -> None:
    rig = moving_rig()
    beat = last_beat(rig)
    rig.device.receive(encode(replace(beat, counter=beat.counter + 1000)))
    status, result = rig.finish()
    assert status == GoalStatusCode.ABORTED
    assert "heartbeat" in result.error_string
    assert rig.events().count("heartbeat_renewed") == 1
    assert last_beat(rig).session != beat.session
    assert rig.run(3.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    assert rig.goal(move(rig.messages(JOINT_STATES)[-1].position, HOME), "next").accepted
    assert rig.finish("next")[0] == GoalStatusCode.SUCCEEDED


def test_a_gateway_that_was_frozen_itself_blames_nobody() -> None:
    rig = moving_rig()
    rig.gateway_is_on = False
    rig.run(0.8)
    rig.gateway_is_on = True
    rig.finish(seconds=3.0)
    assert "heartbeat_renewed" not in rig.events()


def test_a_lost_status_is_asked_for() -> None:
    rig = VirtualArm().ready()
    rig.lost.add("status")
    rig.new_gateway()
    rig.run(1.0)
    assert rig.core.not_ready(rig.moment) == because("device.unidentified", device="rm1")
    rig.lost.clear()
    rig.run(1.5)
    assert not rig.core.not_ready(rig.moment)
    asked = len(commands(rig))
    rig.run(3.0)
    assert len(commands(rig)) == asked


def test_a_device_that_cannot_be_asked_is_left_alone_and_heard_when_it_speaks() -> None:
    rig = VirtualArm().ready()
    rig.lost.update(("status", "cmd"))
    rig.new_gateway()
    assert rig.run(1.0, lambda: bool(commands(rig)))
    asked = commands(rig)[-1]
    assert asked.cmd == STATUS
    refusal = CommandReply(boot_id=77, cmd_id=asked.cmd_id, cmd=STATUS, code=Code.UNKNOWN_CMD, mode=3, t_us=0)
    rig.receive(Kind.CMD_ACK, encode(refusal))
    count = len(commands(rig))
    rig.run(5.0)
    assert len(commands(rig)) == count
    rig.lost.clear()
    rig.device.report_status()
    rig.ready()


def test_a_device_says_its_status_over_its_serial_line_too() -> None:
    device = CoreDevice(device_config(rm1()), boot_id=77)
    device.attach_line()
    device.receive_serial(b"\0" + packet(encode(Sync(t0=1))))
    device.take_serial()
    device.receive_serial(packet(encode(CommandFrame(boot_id=77, cmd_id=1, expires_us=NEVER, cmd=STATUS))))
    assert b"reset_cause" in device.take_serial()


def test_what_a_board_says_of_its_memory_goes_along_in_its_status() -> None:
    rig = VirtualArm().ready()
    memory = {"heap_free": 71000, "heap_least": 40200, "stack_least": 812, "stack_task": "wire"}
    rig.device.report_status()
    said = next(frame.payload for frame in rig.device.take() if frame.kind == "status")
    rig.receive(Kind.STATUS, msgspec.json.encode(msgspec.json.decode(said) | memory))
    assert rig.run(3.0, lambda: bool(rig.messages(DEVICE_STATUS)) and rig.messages(DEVICE_STATUS)[-1].heap_free > 0)
    status = rig.messages(DEVICE_STATUS)[-1]
    assert {name: getattr(status, name) for name in memory} == memory


def test_an_empty_status_is_counted_and_changes_nothing() -> None:
    rig = VirtualArm().ready()
    before = rig.core.bad_frames
    rig.receive(Kind.STATUS, b"", retained=True)
    assert rig.core.bad_frames == before + 1
    assert not rig.core.not_ready(rig.moment)
    assert "cleared it at the broker" in rig.log[-1]


def test_a_state_from_far_ahead_of_the_devices_clock_is_dropped() -> None:
    rig = moving_rig()
    rig.receive(Kind.STATE, encode(StateFrame(boot_id=77, t_us=2**60, mode=4, steps=(1, 2, 3), velocity=(0, 0, 0))))
    assert rig.core.bad_frames == 1
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED


def test_the_hold_of_an_impostor_is_called_that() -> None:
    rig = moving_rig()
    hold = CommandFrame(boot_id=77, cmd_id=999, expires_us=NEVER, cmd=DeviceCommandKind.HOLD)
    rig.device.receive(encode(hold))
    status, result = rig.finish()
    assert status == GoalStatusCode.ABORTED
    assert "somebody else has sent it HOLD" in result.error_string
    assert "heartbeat" not in result.error_string


def test_a_command_under_the_id_of_the_gateways_stop_does_not_swallow_it() -> None:
    rig = moving_rig()
    rig.command(DeviceCommandKind.STOP)
    stop = commands(rig)[-1]
    rig.device.receive(encode(replace(stop, cmd=DeviceCommandKind.SPEED, argument=1000)))
    rig.finish(seconds=1.5)
    assert rig.answers[1].accepted
    assert rig.device.mode == DeviceMode.IDLE
