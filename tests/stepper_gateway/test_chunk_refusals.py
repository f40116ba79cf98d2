"""A chunk that the device refuses: the joint, the value and the limit in their own unit."""

from __future__ import annotations

import pytest

from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.frames import NO_JOINT, Ack, Code
from gemelo.services.stepper_gateway.motion.stream import refusal
from gemelo.tools.virtual_arm.virtual_arm import rm1


def refused(code: int, joint: int = 1) -> Reason:
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
    reason = refused(code)
    assert str(reason) == f"the device refuses {expected}"
    about = {"chunk": 3, "knot": 2, "answer": code.name, "joint": "antebrazo_joint"}
    assert reason == because("ending.knot_refused", value=2.5, limit=2.0, unit=unit, **about)


def test_a_refusal_of_no_joint_has_plain_numbers() -> None:
    reason = refused(Code.GAP, NO_JOINT)
    assert str(reason) == "the device refuses chunk 3 (GAP: 640, limit 512)"
    assert reason == because("ending.chunk_refused", chunk=3, answer="GAP", value=640, limit=512)


def test_a_code_of_a_newer_firmware_is_given_by_its_number() -> None:
    assert "(code 99: 640" in str(refused(99, NO_JOINT))
