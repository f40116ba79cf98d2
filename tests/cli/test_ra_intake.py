"""A publisher's `ra/juntas` on an arm of ours: absolute inside, exact, within the limits, refused with a reason."""

from __future__ import annotations

import contextlib
import json
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.tools.cli.device.ra_intake import RaIntake, RefusedMessage
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.profiles import examples

STANDS = (0, 0, 0)


def said(q1: float, q2: float, q3: float, **more: object) -> bytes:
    return json.dumps({"q1": q1, "q2": q2, "q3": q3, **more}).encode()


def test_ten_messages_a_second_add_up_to_ninety_degrees_at_our_shaft() -> None:
    """What the sketch loses all but a degree of: the publisher's 100 messages of 0.9 degrees arrive to the step."""
    arm, intake = VirtualArm().ready(), RaIntake(rm1())
    for _ in range(100):
        intake.take(said(0.9, 0.9, 0.0, avanzar=0), arm.device.steps)
        target = intake.target
        assert target is not None
        for _ in range(2):
            arm.target(**dict(zip(arm.arm.joint_names, target, strict=True)))
            arm.run(0.05)
    for _ in range(100):
        if intake.is_reached(arm.device.steps):
            break
        arm.target(**dict(zip(arm.arm.joint_names, target, strict=True)))
        arm.run(0.05)
    arm.run(1.0)
    assert arm.device.steps == (round(18662.4 / 4), 100, 0)
    assert intake.is_reached(arm.device.steps)


@given(st.lists(st.tuples(*[st.floats(-0.5, 0.5)] * 3), max_size=40))
def test_no_remainder_of_any_message_is_lost(moves: list[tuple[float, float, float]]) -> None:
    intake, wanted = RaIntake(rm1()), [Fraction(0)] * 3
    ratios = [joint.steps.steps_per_turn / 360 for joint in rm1().joints]
    for move in moves:
        with contextlib.suppress(RefusedMessage):
            intake.take(said(*move), STANDS)
            wanted = [a + Fraction(b) * ratio for a, b, ratio in zip(wanted, move, ratios, strict=True)]
    assert intake.target_steps is None or list(intake.target_steps) == wanted


def test_a_message_beyond_a_limit_is_refused_and_what_was_asked_before_stays() -> None:
    intake = RaIntake(rm1())
    intake.take(said(90.0, 0.0, 0.0), STANDS)
    before = intake.target
    with pytest.raises(RefusedMessage, match=r'joint "brazo_joint" \(q1\).*beyond its limit of 2\.9500 rad: 10\.97'):
        intake.take(said(90.0, 0.0, 0.0), STANDS)
    assert intake.target == before


@pytest.mark.parametrize(
    ("payload", "code"),
    [
        (b'{"q1": 1, "q2": 1}', "ra.missing"),
        (b'{"q1": 1, "q2": "x", "q3": 0}', "ra.not_degrees"),
        (b'{"q1": NaN, "q2": 0, "q3": 0}', "ra.far"),
        (b'{"q1": 1e300, "q2": 0, "q3": 0}', "ra.far"),
        (b'{"q1": true, "q2": 0, "q3": 0}', "ra.not_degrees"),
        (b'{"avanzar": 7}', "ra.output"),
        (b"[1, 2, 3]", "ra.no_object"),
        (b"q1=3", "ra.no_json"),
        (b"{" + b" " * 300 + b"}", "ra.long"),
    ],
)
def test_what_cannot_be_followed_is_refused_with_the_reason(payload: bytes, code: str) -> None:
    with pytest.raises(RefusedMessage) as refused:
        RaIntake(rm1()).take(payload, STANDS)
    assert refused.value.reason.code == code


def test_a_message_without_q3_switches_its_output_and_moves_nothing() -> None:
    """The seed's sketch obeys what is there, and moves only by all joints."""
    intake = RaIntake(rm1())
    wanted = intake.take(b'{"q1": 1, "q2": 1, "avanzar": 1}', STANDS)
    assert (wanted.moves, wanted.output) == (None, True)
    assert wanted.objection is not None
    assert wanted.objection.code == "ra.missing"
    assert wanted.objection.values == {"missing": "q3", "names": "q1, q2, q3"}
    assert intake.target is None


def test_the_output_alone_moves_nothing() -> None:
    intake = RaIntake(rm1())
    assert intake.take(b'{"avanzar": 1}', STANDS) == (None, True, None)
    assert intake.target is None


def test_after_a_stop_the_next_message_counts_from_where_the_arm_is() -> None:
    intake = RaIntake(rm1())
    intake.take(said(45.0, 0.0, 0.0), STANDS)
    intake.forget()
    intake.take(said(1.8, 0.0, 0.0), (1000, 0, 0))
    assert intake.target_steps == (Fraction(1000) + Fraction(1.8) * Fraction(1296, 25), 0, 0)


@examples(full=150)
@given(st.binary(max_size=300) | st.text(max_size=60).map(lambda text: json.dumps({"q1": text}).encode()))
def test_any_bytes_are_followed_or_refused(payload: bytes) -> None:
    with contextlib.suppress(RefusedMessage):
        RaIntake(rm1()).take(payload, STANDS)
