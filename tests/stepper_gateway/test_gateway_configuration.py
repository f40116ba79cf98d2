"""The device's configuration: given where it may be, asked for where a person must help; a wrong one never moves."""

from __future__ import annotations

from dataclasses import replace as with_

import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.schemas.device import ConfigureResponse, DeviceCommandKind, DeviceConfiguration, DeviceMode
from gemelo.schemas.device_config import config_crc, config_text
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.topics import DEVICE_CONFIGURATION, DEVICE_STATUS
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import ConfigureInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import move

HOME = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)
WANTED = device_config(rm1())
SLOWER = replace(WANTED, joints=(replace(WANTED.joints[0], max_velocity_q8=400_000), *WANTED.joints[1:]))
TWO_JOINTS = replace(WANTED, joints=WANTED.joints[:2], inputs=WANTED.inputs[:3])


def told(rig: VirtualArm) -> DeviceConfiguration:
    message: DeviceConfiguration = rig.messages(DEVICE_CONFIGURATION)[-1]
    return message


def works(rig: VirtualArm) -> None:
    """Armed and referenced again, it moves."""
    rig.run(0.1)
    rig.ready()
    for ticket, kind in enumerate((DeviceCommandKind.ARM, DeviceCommandKind.REFERENCE), start=10):
        rig.command(kind, ticket)
        rig.run(0.3)
        assert rig.answers[ticket].accepted, rig.answers[ticket].reason
    assert rig.goal(move(HOME, NEAR), "next").accepted
    assert not rig.finish("next")[1].error_string


def test_a_device_with_the_right_configuration_is_left_alone_and_said_to_have_it() -> None:
    rig = VirtualArm().ready()
    rig.run(2.0)
    assert not [kind for _, kind, _ in rig.sent if kind == Kind.CONFIG]
    status = rig.messages(DEVICE_STATUS)[-1]
    assert status.config_crc32 == status.wanted_crc32 == config_crc(config_text(WANTED))
    assert told(rig).accepted
    assert told(rig).text.encode() == config_text(WANTED)
    assert told(rig).crc32 == told(rig).device_crc32 == status.wanted_crc32


@pytest.mark.parametrize("other", [SLOWER, TWO_JOINTS])
def test_an_armed_device_with_another_configuration_moves_nothing_and_says_what_to_do(other: object) -> None:
    rig = VirtualArm(config=other)  # type: ignore[arg-type]
    rig.run(1.0)
    assert not [kind for _, kind, _ in rig.sent if kind == Kind.CONFIG]
    verdict = rig.goal(move(HOME, NEAR))
    assert verdict.code == FollowErrorCode.DEVICE_FAILED
    status = rig.messages(DEVICE_STATUS)[-1]
    assert status.online
    for reason in (verdict.reason, status.reason, told(rig).reason):
        assert "gemelo device config --push" in reason
        assert f"{status.config_crc32:08x}" in reason
    assert not told(rig).accepted
    for ticket, kind in enumerate((DeviceCommandKind.HOME, DeviceCommandKind.REFERENCE, DeviceCommandKind.RESUME)):
        rig.command(kind, ticket)
        assert "--push" in rig.answers[ticket].reason
    refused = rig.configure()
    assert not refused.accepted
    assert "armed" in refused.reason

    rig.command(DeviceCommandKind.DISARM, 5)
    assert rig.run(1.0, lambda: rig.device.config == WANTED)
    assert rig.answers[5].accepted
    rig.run(0.2)
    assert told(rig).accepted
    assert rig.configure() == ConfigureResponse(accepted=True, crc32=config_crc(config_text(WANTED)))
    works(rig)


def test_a_disarmed_device_is_configured_at_once() -> None:
    rig = VirtualArm(config=replace(SLOWER, armed_at_boot=False))
    assert rig.run(1.0, lambda: rig.device.config == WANTED)
    assert rig.device.mode == DeviceMode.UNREFERENCED
    rig.run(0.2)
    assert "configured" in rig.events()
    works(rig)


def test_a_device_that_has_nothing_yet_is_configured_at_once() -> None:
    rig = VirtualArm()
    rig.unconfigure()
    assert rig.run(2.0, lambda: rig.device.config == WANTED)
    works(rig)


def test_a_configuration_that_the_device_refuses_is_said_with_its_words_and_not_pushed_again_and_again() -> None:
    arm = rm1()
    impossible = with_(arm, device=replace(arm.device, enable_pin=25))  # which is q1's STEP
    rig = VirtualArm(arm=impossible, config=replace(WANTED, armed_at_boot=False))
    rig.run(5.0)
    assert len([kind for _, kind, _ in rig.sent if kind == Kind.CONFIG]) == 1
    assert "refuses the configuration" in told(rig).reason
    assert "pin" in told(rig).reason
    assert "pin" in rig.configure().reason
    assert not rig.goal(move(HOME, NEAR)).accepted


def test_somebody_elses_retained_configuration_is_replaced_and_moves_nothing() -> None:
    rig = VirtualArm(config=replace(WANTED, armed_at_boot=False))
    assert rig.run(1.0, lambda: rig.device.config == WANTED)
    rig.run(1.5)
    rig.device.receive_config(config_text(SLOWER), retained=True)
    assert rig.device.config == SLOWER
    assert rig.run(2.0, lambda: rig.device.config == WANTED)
    works(rig)


def test_an_armed_device_that_meets_a_stale_retained_one_works_on_and_the_stale_one_is_overwritten() -> None:
    rig = VirtualArm().ready()
    rig.device.receive_config(config_text(SLOWER), retained=True)
    rig.run(1.5)
    assert rig.device.config == WANTED
    assert [payload for _, kind, payload in rig.sent if kind == Kind.CONFIG] == [config_text(WANTED)]
    assert rig.goal(move(HOME, NEAR)).accepted
    assert not rig.finish()[1].error_string


def test_a_lost_configuration_is_sent_again() -> None:
    rig = VirtualArm(config=replace(SLOWER, armed_at_boot=False))
    rig.run(0.02)
    rig.lost.add(Kind.CONFIG)
    rig.run(2.5)
    assert rig.device.config != WANTED
    rig.lost.clear()
    assert rig.run(1.5, lambda: rig.device.config == WANTED)


def test_a_request_for_the_configuration_of_an_absent_device_says_that_it_is_absent() -> None:
    rig = VirtualArm().ready()
    rig.wire.is_cut = True
    rig.run(1.0)
    assert "silent" in rig.configure().reason
    assert not told(rig).accepted


def test_a_flood_of_people_who_want_the_configuration_given_costs_one_frame_a_second() -> None:
    rig = VirtualArm().ready()
    rig.lost.add("config/ack")
    before = len([kind for _, kind, _ in rig.sent if kind == Kind.CONFIG])
    for ticket in range(1, 501):
        rig.handle(ConfigureInput(ticket))
    assert len([kind for _, kind, _ in rig.sent if kind == Kind.CONFIG]) == before + 1
    rig.lost.clear()
    assert rig.run(2.0, lambda: len(rig.configured) == 500)
    assert all(answer.accepted for answer in rig.configured.values())
