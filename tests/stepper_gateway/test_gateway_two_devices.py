"""Two devices under one name, and other programs on its topics: each is named, and nothing moves beside a second."""

from __future__ import annotations

import json

import pytest

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.libraries.arm.device.device_config import device_config, reference_steps
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceStatus, StopKind
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.topics import DEVICE_STATUS
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.virtual_arm import BOOT_ID, VirtualArm, rm1
from tests.stepper_gateway.harness import move

HOME, READY = (0.0, 0.0, 0.0), (0.6, -1.2, 0.08)
OTHER_BOOT = 0x5B8FAC7
NOTICED = 1.0  # [s] of two devices until that is known
GONE = 2.0  # [s] after one of them is gone until the other may move


class TwoDevices(VirtualArm):
    """A device, and another one of its name while `second` is there; what is sent reaches both."""

    def __init__(self) -> None:
        self.second: CoreDevice | None = None
        self._zero = 0  # [us] of virtual time when the second one started
        super().__init__(step_us=5000)

    def switch_on(self) -> None:
        """The second one starts at its reference pose, as a forgotten `make up` does."""
        self._zero = self.now_us
        self.second = CoreDevice(device_config(rm1()), OTHER_BOOT, 0, reference_steps(rm1()))
        self.second.report_status()

    def send(self, kind: Kind, payload: bytes) -> None:
        super().send(kind, payload)
        if self.second is not None and kind is not Kind.CONFIG:
            self.second.receive(payload)

    def _step(self, end: int) -> None:
        super()._step(end)
        if self.second is not None:
            self.second.advance(self.now_us - self._zero)
            for frame in self.second.take():
                payload = frame.payload
                if frame.kind == "status":
                    payload = json.dumps(json.loads(payload) | {"place": "process 12 on workshop, /home/ana"}).encode()
                self.receive(Kind(frame.kind), payload)

    @property
    def told(self) -> DeviceStatus:
        status: DeviceStatus = self.messages(DEVICE_STATUS)[-1]
        return status


@pytest.mark.parametrize("is_second_first", [False, True])
def test_two_devices_of_one_name_are_named_and_nothing_moves_until_one_is_gone(is_second_first: bool) -> None:
    arm = TwoDevices()
    if is_second_first:
        arm.device_is_on = False
        arm.switch_on()
        assert arm.run(3.0, lambda: not arm.reason_not_ready)
        arm.device_is_on = True
        arm.device.report_status()
    else:
        arm.ready()
        arm.switch_on()
    assert arm.run(NOTICED, lambda: "two devices" in arm.told.reason)
    arm.run(12.0)  # each says its status once in 10 s
    assert not arm.told.online
    for said in (
        'two devices call themselves "rm1"', f"boot {BOOT_ID:08x} (virtual", f"boot {OTHER_BOOT:08x} (virtual",
        "process 12 on workshop, /home/ana", "nothing moves until there is one", "`make up` in another folder",
    ):  # fmt: skip
        assert said in arm.told.reason
    verdict = arm.goal(move(HOME, READY))
    assert (verdict.accepted, verdict.code) == (False, FollowErrorCode.DEVICE_FAILED)
    assert "two devices call themselves" in verdict.reason
    arm.second = None
    assert arm.run(GONE, lambda: arm.told.online)
    assert arm.goal(move(HOME, READY), "after").accepted
    assert arm.finish("after")[0] is GoalStatusCode.SUCCEEDED


def test_a_motion_ends_at_rest_when_a_second_device_comes_and_a_stop_works_beside_it() -> None:
    arm = TwoDevices()
    arm.ready()
    assert arm.goal(move(HOME, READY)).accepted
    arm.run(0.3)
    arm.switch_on()
    status, result = arm.finish("g", 3.0)
    assert status is GoalStatusCode.ABORTED
    assert "two devices call themselves" in result.error_string
    assert arm.run(2.0, lambda: not arm.device.moving)
    assert arm.second is not None
    assert arm.second.steps == reference_steps(rm1())
    arm.ask(StopKind.STOP, 99)
    assert arm.run(0.5, lambda: 99 in arm.answers)
    assert arm.answers[99].accepted


def test_a_device_that_restarts_is_no_second_one() -> None:
    arm = TwoDevices()
    arm.ready()
    for boot in range(200, 206):
        arm.reboot(boot)
        arm.run(0.7)
        assert not [each for each in arm.messages(DEVICE_STATUS) if "devices call" in each.reason]
    arm.run(3.0)
    assert arm.told.online


def test_old_states_that_come_again_in_a_heap_are_no_second_device() -> None:
    arm = TwoDevices()
    arm.ready()
    arm.switch_on()
    other, arm.second = arm.second, None
    assert other is not None
    other.advance(1_000_000)
    heap = [frame.payload for frame in other.take() if frame.kind == "state"]
    assert len(heap) >= 40
    for payload in heap:
        arm.receive(Kind.STATE, payload)
    arm.run(1.0)
    assert not [each for each in arm.messages(DEVICE_STATUS) if "devices call" in each.reason]


@pytest.mark.parametrize(("kind", "text"), [(Kind.STATE, b"q1=10"), (Kind.EVENT, b"hola"), (Kind.SENSORS, b"[1]")])
def test_an_old_sketch_on_the_devices_topics_is_named_and_ends_no_move(kind: Kind, text: bytes) -> None:
    arm = VirtualArm().ready()
    assert arm.goal(move(HOME, READY)).accepted
    for _ in range(8):
        arm.receive(kind, text)
        arm.run(0.2)
    assert f'writes under the topics of device "rm1" ({kind}: ' in arm.messages(DEVICE_STATUS)[-1].warning
    assert arm.finish("g")[0] is GoalStatusCode.SUCCEEDED
    assert arm.run(11.0, lambda: not arm.messages(DEVICE_STATUS)[-1].warning)


def test_a_garbled_frame_now_and_then_is_no_other_program() -> None:
    arm = VirtualArm().ready()
    for number in range(12):
        arm.receive(Kind.STATE, bytes([0xA5, number]) if number % 4 == 0 else b"\xff" + bytes(40))
        arm.run(3.0)
    assert not any(each.warning for each in arm.messages(DEVICE_STATUS))


def test_how_long_a_device_does_not_hear_is_said_and_ends_when_it_hears() -> None:
    arm = VirtualArm().ready()
    arm.run(1.0)
    cut = arm.moment.unix
    arm.lost = {"hb", "sync", "cmd", "traj"}
    arm.run(12.0)
    told = arm.messages(DEVICE_STATUS)[-1]
    assert not told.online
    assert abs(told.deaf_since - cut) < 0.6e9
    assert len({each.deaf_since for each in arm.messages(DEVICE_STATUS)} - {0}) == 1
    arm.lost = set()
    arm.run(2.0)
    assert arm.messages(DEVICE_STATUS)[-1].deaf_since == 0
