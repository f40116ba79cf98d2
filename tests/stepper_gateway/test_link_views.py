"""Views of a device that speaks and does not hear, of two of one name, and of a figure that is old."""

from __future__ import annotations

from typing import Any

import pytest

from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.topics import DEVICE_STATE, DEVICE_STATUS
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.visualizer.content.panel import PanelInputs, panel
from gemelo.tools.cli.device import device_status
from gemelo.tools.cli.device.device_snapshot import device_snapshot
from gemelo.tools.cli.watch import doctor, state
from gemelo.tools.virtual_arm.gateway_driver import PlannerInput, SceneInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.test_gateway_twins import Twins
from tests.stepper_gateway.test_gateway_two_devices import TwoDevices

CUT = {"hb", "sync", "cmd", "traj"}


def newest(arm: VirtualArm, topic: Any) -> Any:
    return arm.messages(topic)[-1]


def shown(arm: VirtualArm, later: float = 0.0) -> dict[str, str]:
    """The text of every view; `later` [s] after the device's last state has come."""
    status: DeviceStatus = newest(arm, DEVICE_STATUS)
    seen: DeviceState = newest(arm, DEVICE_STATE)
    now = arm.moment.unix + round(later * 1e9)
    found = [doctor.device(status, seen, "", now), *doctor.warning(status)]
    return {
        "state": state.text_of(state.snapshot(rm1(), None, None, seen, status, None, now=now, age=later)),
        "status": device_status.text_of(device_snapshot(rm1(), status, seen, None, None, now, later)),
        "doctor": " ".join(f"{each.verdict} {each.found} {each.remedy}" for each in found),
        "viewer": panel(PanelInputs(robot="rm1", status=status, state=seen), now),
    }


def test_a_device_that_does_not_hear_is_said_with_the_time_the_causes_and_the_age_of_its_round_trip() -> None:
    arm = VirtualArm().ready()
    arm.run(1.0)
    arm.lost = CUT
    arm.run(12.4)
    for view, text in shown(arm).items():
        for said in (
            'device "rm1" speaks and does not hear', "(for 12 s)", "a loose TX wire", "ACL that denies the device its",
            "two boards or programs with one client id",
        ):  # fmt: skip
            assert said in text, view
        assert "offline" not in text.lower(), view
        assert "NOT USABLE" in text.upper(), view
    texts = shown(arm)
    assert texts.pop("doctor").startswith("error ")
    for view, text in texts.items():
        assert "round trip 3.0 ms, measured 12 s ago" in text, view


def test_a_round_trip_of_now_has_no_age_and_one_of_a_silent_device_grows_old() -> None:
    arm = VirtualArm().ready()
    for view, text in shown(arm).items():
        assert "round trip 3.0 ms" in text, view
        assert "measured" not in text, view
    later = shown(arm, 40.0)
    assert "round trip 3.0 ms, measured 40 s ago" in later["state"]
    assert "round trip 3.0 ms, measured 40 s ago" in later["status"]


def test_two_devices_of_one_name_are_named_in_every_view() -> None:
    arm = TwoDevices()
    arm.ready()
    arm.switch_on()
    assert arm.run(1.0, lambda: "two devices" in arm.told.reason)
    for view, text in shown(arm).items():
        for said in ('two devices call themselves "rm1"', "boot 0000004d (virtual", "boot 05b8fac7", "nothing moves"):
            assert said in text, view
    assert shown(arm)["doctor"].startswith("error ")


def test_two_gateways_on_one_device_are_said_in_every_view() -> None:
    arm = Twins()
    arm.ready()
    arm.join()
    assert arm.run(2.0, lambda: "another gateway" in newest(arm, DEVICE_STATUS).reason)
    for view, text in shown(arm).items():
        assert "is asked by another gateway too: nothing moves until there is one" in text, view
        assert "a forgotten `make up`" in text, view
        assert "NOT USABLE" in text.upper(), view


@pytest.mark.parametrize("cause", ["two planners live, process 1 on a and process 2 on b", "an old sketch"])
def test_what_is_to_mend_beside_an_online_device_is_in_every_view(cause: str) -> None:
    arm = VirtualArm().ready()
    if "planners" in cause:
        for number, instance in enumerate(("1.1.a", "2.2.b"), 1):
            arm.handle(PlannerInput(instance, True))
            arm.handle(SceneInput(number, 0, instance))
    else:
        for _ in range(6):
            arm.receive(Kind.STATE, b"q1=10 q2=20")
    arm.run(0.1)
    for view, text in shown(arm).items():
        assert cause in text, view
    assert "warning " in shown(arm)["doctor"]
