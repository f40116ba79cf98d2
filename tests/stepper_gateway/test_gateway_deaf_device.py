"""A device that speaks and hears nothing, because its link's reader has died: goals end, and nothing moves later."""

from __future__ import annotations

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceMode
from gemelo.services.stepper_gateway.links.link import TO_DEVICE
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

HOME, READY = (0.0, 0.0, 0.0), (0.6, -1.2, 0.08)
EVERYTHING = set(TO_DEVICE)


def test_a_goal_for_a_deaf_device_ends_within_two_seconds_and_the_next_one_is_refused() -> None:
    rig = VirtualArm().ready()
    stood = rig.device.steps
    rig.lost = EVERYTHING
    assert rig.goal(move(HOME, READY)).accepted
    status, result = rig.finish("g", 2.0)
    assert status == GoalStatusCode.ABORTED
    assert "speaks and does not hear" in result.error_string
    assert rig.goal(move(HOME, READY), "next").reason == result.error_string
    rig.lost = set()
    rig.run(5.0)
    assert rig.device.steps == stood
    assert rig.goal(move(HOME, READY), "heard").accepted
    assert rig.finish("heard")[0] == GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize("at", [0.3, 1.2])
def test_a_goal_ends_whose_device_grows_deaf_in_the_move_and_it_does_not_go_on_when_it_hears_again(at: float) -> None:
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(at)
    rig.lost = EVERYTHING
    status, result = rig.finish("g", 6.0)
    assert status == GoalStatusCode.ABORTED
    assert "it lost the gateway's heartbeat" in result.error_string
    assert "answers nothing" in result.error_string
    assert rig.device.mode == DeviceMode.HOLD
    stood = rig.device.steps
    rig.lost = set()
    assert rig.run(3.0, lambda: rig.state.mode == DeviceMode.IDLE)
    assert rig.device.steps == stood
    assert rig.goal(move(rig.position, HOME), "next").accepted
    assert rig.finish("next")[0] == GoalStatusCode.SUCCEEDED


def test_an_arm_that_has_not_come_to_rest_yet_is_waited_for() -> None:
    """No answer to STOP and no rest: the goal ends only when the device says that it stands."""
    rig = VirtualArm().ready()
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(0.8)
    rig.lost = {"cmd"}
    assert rig.handle(CancelInput("g")).why is None
    assert rig.finish("g", 6.0)[0] == GoalStatusCode.CANCELED
    assert not any(rig.state.velocity)
    stood = rig.device.steps
    rig.lost = set()
    rig.run(3.0)
    assert rig.device.steps == stood
