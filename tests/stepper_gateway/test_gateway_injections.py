"""Presses of a virtual device's world, as its own process takes them; a real device's cannot be pressed."""

from __future__ import annotations

import json
from contextlib import closing

import pytest

from gemelo.schemas.device import DeviceMode, InjectKind, InjectRequest
from gemelo.services.stepper_gateway.device.injection_handler import target_of
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import InjectInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.processes import Processes
from tests.stepper_gateway.wired import WiredGateway

ESTOP = InjectRequest(kind=InjectKind.ESTOP)


def virtual(rig: VirtualArm) -> VirtualArm:
    """What this device says of itself from now on."""
    rig.ready()
    status = {"online": True, "device": "rm1", "boot_id": 77, "joints": 3, "tick_hz": 50_000, "queue_capacity": 128}
    crc = rig.core.device.configuration.crc32
    rig.receive(Kind.STATUS, json.dumps(status | {"config_crc32": crc, "virtual": True}).encode())
    return rig


def say(rig: VirtualArm, event: str, detail: str = "") -> None:
    rig.receive(Kind.EVENT, json.dumps({"event": event, "t_us": 1, "detail": detail}).encode())


def presses(rig: VirtualArm) -> list[str]:
    return [json.loads(payload)["kind"] for _, kind, payload in rig.sent if kind == Kind.INJECT]


def test_a_real_device_is_not_pressed_by_a_request() -> None:
    rig = VirtualArm().ready()
    status = {"online": True, "boot_id": 77, "joints": 3, "config_crc32": rig.core.device.configuration.crc32}
    for _ in range(2):  # it is asked again before a change is believed
        rig.receive(Kind.STATUS, json.dumps(status).encode())
    rig.handle(InjectInput(1, ESTOP))
    assert not rig.pressed[1].accepted
    assert "by hand" in rig.pressed[1].reason
    assert not presses(rig)


def test_presses_go_out_one_at_a_time_and_each_gets_its_own_answer() -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, ESTOP))
    rig.handle(InjectInput(2, InjectRequest(kind=InjectKind.SWITCH, target="limit_q1")))
    assert presses(rig) == ["estop"]
    say(rig, "injected")
    assert rig.pressed[1].accepted
    assert presses(rig) == ["estop", "switch"]
    say(rig, "inject_refused", "no such switch")
    assert (rig.pressed[2].accepted, rig.pressed[2].reason) == (False, "no such switch")


def test_a_press_that_is_not_answered_is_given_up_and_the_next_one_goes_out() -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, ESTOP))
    rig.handle(InjectInput(2, ESTOP))
    rig.run(2.5)
    assert "not answered" in rig.pressed[1].reason
    assert presses(rig) == ["estop", "estop"]


def test_a_device_that_starts_anew_before_its_answer_has_left_was_pressed() -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, InjectRequest(kind=InjectKind.REBOOT)))
    rig.handle(InjectInput(2, ESTOP))
    rig.reboot(boot_id=78)
    assert rig.run(1.0, lambda: 1 in rig.pressed)
    assert rig.pressed[1].accepted
    assert presses(rig) == ["reboot", "estop"]
    assert 2 not in rig.pressed  # of that nothing is known yet


def test_a_press_of_something_else_is_not_done_by_a_reboot() -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, ESTOP))
    rig.reboot(boot_id=78)
    rig.run(1.0)
    assert "rebooted" in rig.events()
    assert 1 not in rig.pressed
    rig.run(1.5)
    assert not rig.pressed[1].accepted


def last_will(rig: VirtualArm, boot_id: int = 77) -> None:
    rig.receive(Kind.STATUS, json.dumps({"online": False, "device": "rm1", "boot_id": boot_id}).encode())


def test_a_device_that_vanishes_before_its_answer_has_left_is_offline_as_was_asked() -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, InjectRequest(kind=InjectKind.OFFLINE, value=1.0)))
    last_will(rig)
    assert rig.pressed[1].accepted


@pytest.mark.parametrize(("kind", "boot_id"), [(InjectKind.ESTOP, 77), (InjectKind.OFFLINE, 76)])
def test_no_last_will_is_the_answer_to_another_press_or_of_another_boot(kind: InjectKind, boot_id: int) -> None:
    rig = virtual(VirtualArm())
    rig.handle(InjectInput(1, InjectRequest(kind=kind)))
    last_will(rig, boot_id)
    assert 1 not in rig.pressed
    rig.run(2.5)
    assert not rig.pressed[1].accepted


def test_an_absent_device_is_not_pressed() -> None:
    rig = virtual(VirtualArm())
    rig.wire.is_cut = True
    rig.run(1.0)
    rig.handle(InjectInput(1, ESTOP))
    assert "silent" in rig.pressed[1].reason


@pytest.mark.parametrize(
    ("press", "target", "known"),
    [
        (InjectKind.BLOCK, "antebrazo_joint", "q2"),
        (InjectKind.SLIP, "q3", "q3"),
        (InjectKind.SWITCH, "limit_q1", "limit_q1"),
        (InjectKind.SENSOR, "ultra", "ultra"),
        (InjectKind.REBOOT, "", ""),
    ],
)
def test_a_target_is_said_as_the_device_knows_it(press: InjectKind, target: str, known: str) -> None:
    assert target_of(InjectRequest(kind=press, target=target), rm1()) == known


@pytest.mark.parametrize(
    ("press", "target", "nearest"),
    [
        (InjectKind.BLOCK, "antebraso_joint", "antebrazo_joint"),
        (InjectKind.SWITCH, "limt_q1", "limit_q1"),
        (InjectKind.SENSOR, "baterya", "bateria"),
    ],
)
def test_a_target_that_is_not_there_is_refused_with_the_nearest(press: InjectKind, target: str, nearest: str) -> None:
    with pytest.raises(GoalRejected, match=f'did you mean "{nearest}"'):
        target_of(InjectRequest(kind=press, target=target), rm1())


@pytest.mark.full
def test_the_virtual_devices_own_process_is_pressed_released_and_blocked(processes: Processes) -> None:
    with closing(WiredGateway(processes.port)) as gateway:
        gateway.ready()
        assert gateway.answer_to_press(ESTOP).accepted
        assert gateway.run(2.0, lambda: gateway.state.mode == DeviceMode.ESTOP)
        assert gateway.state.inputs == ("estop",)
        assert gateway.answer_to_press(InjectRequest(kind=InjectKind.ESTOP, value=0.0)).accepted
        assert gateway.run(2.0, lambda: gateway.state.inputs == ())
        assert gateway.answer_to_press(InjectRequest(kind=InjectKind.SLIP, target="brazo_joint", value=25.0)).accepted
        assert gateway.run(2.0, lambda: gateway.published["device/shaft"][-1].shaft[0] == 25)
        refused = gateway.answer_to_press(InjectRequest(kind=InjectKind.DRIFT, value=1e9))
        assert not refused.accepted
        assert refused.reason
