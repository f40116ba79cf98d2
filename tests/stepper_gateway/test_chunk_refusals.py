"""A chunk that the device refuses, as a sentence: the joint, the value and the limit in their own unit."""

from __future__ import annotations

import pytest

from gemelo.services.stepper_gateway.links.frames import NO_JOINT, Ack, Code
from gemelo.services.stepper_gateway.motion.stream import refusal
from gemelo.tools.virtual_arm.virtual_arm import rm1


def refused(code: int, joint: int = 1) -> str:
    ack = Ack(stream=7, seq=3, next_seq=3, code=code, joint=joint, knot=2, value=640, limit=512)
    return refusal(ack, rm1().joints)


@pytest.mark.parametrize(
    ("code", "unit"),
    [
        (Code.POSITION_LIMIT, "steps"),
        (Code.START_MISMATCH, "steps"),
        (Code.VELOCITY_LIMIT, "steps/s"),
        (Code.NOT_AT_REST, "steps/s"),
        (Code.ACCELERATION_LIMIT, "steps/s^2"),
    ],
)
def test_the_value_has_the_unit_of_its_code(code: Code, unit: str) -> None:
    expected = f'chunk 3, knot 2 ({code.name}): joint "antebrazo_joint" 2.50 {unit}, limit 2.00'
    assert refused(code) == f"the device refuses {expected}"


def test_a_refusal_of_no_joint_is_told_in_plain_numbers() -> None:
    assert refused(Code.GAP, NO_JOINT) == "the device refuses chunk 3 (GAP: 640, limit 512)"


def test_a_code_of_a_newer_firmware_is_told_by_its_number() -> None:
    assert "(code 99: 640" in refused(99, NO_JOINT)
