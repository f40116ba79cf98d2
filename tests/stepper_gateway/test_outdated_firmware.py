"""A firmware that is older than what this gateway drives moves nothing, and the reason says so."""

from __future__ import annotations

import pytest

from gemelo.schemas.reasons import because
from gemelo.services.stepper_gateway.device import readiness
from gemelo.services.stepper_gateway.device.readiness import LEAST_FIRMWARE, outdated_reason
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

HOME, END = (0.0, 0.0, 0.0), (0.1, 0.0, 0.0)


def test_a_goal_for_an_older_firmware_is_refused_with_both_versions_and_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    arm = VirtualArm().ready()
    monkeypatch.setattr(readiness, "LEAST_FIRMWARE", (9, 1, 0))
    reason = arm.goal(move(HOME, END)).reason
    assert 'device "rm1" runs firmware 1.0.0, and this gateway drives 9.1.0 and newer' in reason
    assert "`gemelo device update`" in reason
    arm.run(1.0)
    assert "runs firmware 1.0.0" in arm.published["device/status"][-1].reason
    assert arm.published["device/status"][-1].online, "it is there all the same, and can be updated"
    monkeypatch.setattr(readiness, "LEAST_FIRMWARE", (1, 0, 0))
    assert arm.goal(move(HOME, END), "then").accepted


@pytest.mark.parametrize("firmware", ["0.9.9", "0.10.0", "0.0.1-rc2"])
def test_a_lower_version_is_outdated(firmware: str) -> None:
    assert LEAST_FIRMWARE == (1, 0, 0)
    reason = because("device.firmware.old", device="rm1", firmware=firmware, least="1.0.0")
    assert outdated_reason("rm1", firmware) == reason


@pytest.mark.parametrize("firmware", ["1.0.0", "1.0.0-dirty", "1.0.1", "10.0.0", "", "a sketch"])
def test_a_version_that_is_high_enough_or_none_is_not(firmware: str) -> None:
    assert outdated_reason("rm1", firmware) is None


def test_a_board_of_another_dialect_has_no_version_that_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readiness, "LEAST_FIRMWARE", (9, 1, 0))
    assert SketchArm().referenced().reason_not_ready == ""
