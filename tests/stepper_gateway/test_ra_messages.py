"""Dialect "ra" by itself: what a sketch makes of the messages, how long it takes, and what it says."""

from __future__ import annotations

import contextlib
import json
import os
import random

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.firmware.platform.host.sketch import AustinStepper, HostSketch
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.arm.motors.relative_moves import Loop, Ramp, loop_of, ramp_of
from gemelo.schemas.robot import Sketch as SketchTable
from gemelo.services.stepper_gateway.links.foreign.ra_messages import (
    BadRaMessage,
    degrees,
    joints_message,
    moves,
    read_sensors,
    read_states,
)
from gemelo.services.stepper_gateway.links.foreign.ra_sender import RaSender
from gemelo.tools.virtual_arm.sketch_arm import ra_arm
from tests.stepper_gateway.harness import ROOT

RAMPS = tuple(ramp_of(joint.drive) for joint in ra_arm().joints)
LOOP = loop_of(ra_arm().device)
QUICK = Loop(pass_time=0.0, telemetry_time=0.1)
# The rest is run by hand: RA_MESSAGES=1000000.
MESSAGES = int(os.environ.get("RA_MESSAGES", "3000"))


@pytest.mark.parametrize("truncates", [True, False])
def test_the_sum_of_random_messages_is_the_commanded_steps(truncates: bool) -> None:
    """A sketch that truncates and one that rounds, both with the ESP32's floats, make exactly the steps commanded."""
    rng, sender = random.Random(7), RaSender(RAMPS, (0, 0, 0), Loop(LOOP.pass_time, 1000.0))
    sketch = HostSketch(RAMPS, truncates)
    wanted, shafts, now = [0, 0, 0], [0, 0, 0], 0.0
    for _ in range(MESSAGES):
        wanted = [count + rng.choice((0, 1, -1, rng.randint(-20000, 20000))) for count in wanted]
        now += 1000.0
        sender.heard(now)
        move = sender.take(wanted, True, now)
        if move is None:
            continue
        message = json.loads(joints_message(move, RAMPS, False))
        shafts = [at + sketch.steps(message[ramp.name], ramp) for at, ramp in zip(shafts, RAMPS, strict=True)]
    assert shafts == wanted == sender.sent


@given(st.integers(-(10**5), 10**5), st.sampled_from([*RAMPS, Ramp("q9", RAMPS[0].steps_per_turn / 7, 900.0, 50.0)]))
def test_a_message_is_the_steps_to_a_thousandth_in_degrees_too(steps: int, ramp: Ramp) -> None:
    said = degrees(steps, ramp) * float(ramp.steps_per_turn) / 360.0
    assert abs(said - steps) <= 0.001 + abs(steps) * 1e-6 + 1e-6


@given(st.integers(1, 4000), st.floats(50.0, 8000.0), st.floats(50.0, 20000.0))
def test_a_move_in_quick_passes_is_given_hardly_more_than_it_takes(
    steps: int, speed: float, acceleration: float
) -> None:
    motor = AustinStepper(speed, acceleration)
    motor.move(steps)
    now = 10.0
    while motor.due is not None:
        now = max(now, motor.due)
        motor.step(now)
    assert motor.position == steps
    taken, given_time = now - 10.0, Ramp("q1", RAMPS[0].steps_per_turn, speed, acceleration).duration(steps, QUICK)
    assert taken <= given_time
    assert steps < 100 or given_time <= 1.35 * taken, "it would be needlessly slow"


@pytest.mark.parametrize(("said", "wrong"), [("18662", 0), ("18662.4", 1)])
def test_a_sketch_that_computes_with_a_truncated_ratio_is_driven_by_that(said: str, wrong: int) -> None:
    """`(long) (400 * 46.656)` is 18662: with the exact ratio such a sketch loses a step from 48 steps on."""
    drive = load_arm(ROOT / "urdf/rm1").joints[0].drive
    its_own = ramp_of(msgspec.structs.replace(drive, sketch=SketchTable(steps_per_turn="18662")))
    ours = ramp_of(msgspec.structs.replace(drive, sketch=SketchTable(steps_per_turn=said)))
    sketch = HostSketch([its_own])
    misses = [steps for steps in range(0, 80_001) if sketch.steps(degrees(steps, ours), its_own) != steps]
    assert bool(misses) == bool(wrong)
    assert not misses or misses[0] <= 48


def test_a_message_that_comes_too_early_would_discard_the_rest() -> None:
    """The sketch's own defect, which the pacing is for: the test device has it."""
    sketch = HostSketch(RAMPS)
    for index in range(10):
        sketch.receive(joints_message((466, 10, 0), RAMPS, False))
        sketch.advance(0.1 * (index + 1))
    sketch.advance(10.0)
    assert sketch.discarded > 0
    assert sketch.shafts[0] < 4660


def test_the_old_publisher_at_10_hz_loses_what_the_sketch_has_not_done_in_time() -> None:
    """Ninety degrees in messages of 4.5: the reason for which messages wait for one another here."""
    sketch = HostSketch([ramp._replace(acceleration=3110.0) if ramp.name == "q1" else ramp for ramp in RAMPS])
    for index in range(20):
        sketch.receive(json.dumps({"q1": 4.5, "q2": 4.5, "q3": 0, "avanzar": 0}).encode())
        sketch.advance(0.1 * (index + 1))
    sketch.advance(2.0)
    assert sketch.shafts[1] < 60 < 100


@pytest.mark.parametrize(
    "payload",
    [b"", b"[]", b"{", b'{"ultra": "x"}', b'{"other": 1}', b'{"ultra": null}', b"\xff\xfe", b'{"ultra": 1e400}',
     b'{"ultra": ' + b"9" * 400 + b"}", b"[" * 200],
)  # fmt: skip
def test_what_is_no_reading_is_refused_with_a_sentence(payload: bytes) -> None:
    with pytest.raises(BadRaMessage):
        read_sensors(payload)
    with pytest.raises(BadRaMessage):
        read_states(payload)


@given(st.binary(max_size=300) | st.text(max_size=100).map(lambda text: json.dumps({"ultra": text}).encode()))
def test_any_bytes_are_read_or_refused(payload: bytes) -> None:
    for read in (read_sensors, read_states):
        with contextlib.suppress(BadRaMessage):
            assert read(payload).values


def test_the_sketch_may_have_figures_of_its_own() -> None:
    """Its code says 18662 steps a turn and 3110 steps/s^2, whatever its text says."""
    text = (ROOT / "urdf/rm1/robot.toml").read_text(encoding="utf-8")
    assert "[joint.sketch]" not in text
    drive = load_arm(ROOT / "urdf/rm1").joints[0].drive
    own = ramp_of(drive)
    assert (own.speed, own.acceleration) == (4665.6, 4665.6)


def test_a_ratio_that_is_none_is_refused_by_name() -> None:
    drive = load_arm(ROOT / "urdf/rm1").joints[0].drive
    with pytest.raises(DescriptionError, match=r"brazo_joint.*sketch\.steps_per_turn"):
        ramp_of(msgspec.structs.replace(drive, sketch=SketchTable(steps_per_turn="18662,4")))
    other = ramp_of(msgspec.structs.replace(drive, sketch=SketchTable(steps_per_turn="18662", acceleration=3110.0)))
    assert (float(other.steps_per_turn), other.acceleration) == (18662.0, 3110.0)


@pytest.mark.parametrize(
    ("message", "is_move"),
    [
        (b'{"q1":0,"q2":0,"q3":0}', True),  # it ends the move under way
        (b'{"q1":1,"q2":null,"q3":"2","modo":"viejo"}', True),  # for the sketch's library each is a number
        (b'{"q1":1,"q2":2}', False),
        (b'{"q1":1,"q2":2,"q3":3,"x":"' + b"x" * 256 + b'"}', False),  # longer than the sketch's buffer
        (b"\xff", False),
        (b"[" * 5000, False),
        (b'["q1","q2","q3"]', False),
    ],
)
def test_a_sketch_moves_by_what_names_every_joint(message: bytes, is_move: bool) -> None:
    assert moves(message, [ramp_of(joint.drive) for joint in ra_arm().joints]) is is_move
