"""The messages of dialect "ra": `ra/juntas` to the sketch, `ra/estados` and `ra/sensores` from it. Pure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from gemelo.libraries.arm.motors.relative_moves import LOOP_READING, Ramp

JOINTS, STATES, SENSORS = "ra/juntas", "ra/estados", "ra/sensores"
OUTPUT = "avanzar"
READINGS = ("ultra", "bateria", "estado", LOOP_READING)
LARGEST = 256  # [bytes] standard: PubSubClient's buffer, and nothing that the sketch says is longer
DECIMALS = 9  # of a degree: far below the margin; chosen for short messages
LEAST_MARGIN = 2.0**-10  # [steps] chosen: above every rounding near 0, below what a step shows
# Standard: a sketch on an ESP32 has floats of 24 bits. Three roundings of one part in 2^24 stay below one in 2^20.
FLOAT_MARGIN = 2.0**-20

_decoder = msgspec.json.Decoder(dict[str, int | float | bool | None])


class BadRaMessage(ValueError):
    """What no sketch says; the text says what is wrong."""


class Telemetry(NamedTuple):
    """The numbers in a message of the sketch, by name; `estado` in any spelling is "estado"."""

    values: dict[str, float]


def degrees(steps: int, ramp: Ramp) -> float:
    """[deg] of the output shaft that the sketch turns into exactly `steps`, whether it truncates or rounds."""
    if steps == 0:
        return 0.0
    beyond = math.copysign(LEAST_MARGIN + abs(steps) * FLOAT_MARGIN, steps)
    return round((steps + beyond) * 360.0 / float(ramp.steps_per_turn), DECIMALS)


def joints_message(steps: Sequence[int], ramps: Sequence[Ramp], output: bool) -> bytes:
    """A relative move of all joints; the sketch moves only where it finds every one of them."""
    moves: dict[str, float | int] = {r.name: degrees(count, r) for count, r in zip(steps, ramps, strict=True)}
    return msgspec.json.encode({**moves, OUTPUT: int(output)})


def moves(payload: bytes, ramps: Sequence[Ramp]) -> bool:
    """True if a sketch moves by it, or ends the move under way: it names every joint, and takes for 0 what is none."""
    if len(payload) > LARGEST:
        return False
    try:
        found = msgspec.json.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        return False
    return isinstance(found, dict) and all(ramp.name in found for ramp in ramps)


def output_message(output: bool) -> bytes:
    """The output alone: a move of nought would end the one under way."""
    return msgspec.json.encode({OUTPUT: int(output)})


def read_states(payload: bytes) -> Telemetry:
    """`{"estado": int}`; raises `BadRaMessage`."""
    values = _numbers(payload)
    if "estado" not in values:
        raise BadRaMessage(f'{STATES} without "estado": {_shown(payload)}')
    return Telemetry({"estado": values["estado"]})


def read_sensors(payload: bytes) -> Telemetry:
    """`{"ultra": int}`, `{"bateria": float}`, or `{"Estado": int, "ultra": int}`; raises `BadRaMessage`.

    With each, or alone, `{"loop_us": int}`: the longest pass of the sketch's loop() since the message before.
    """
    values = {name: value for name, value in _numbers(payload).items() if name in READINGS}
    if not values:
        raise BadRaMessage(f'{SENSORS} without "ultra", "bateria", "Estado" or "{LOOP_READING}": {_shown(payload)}')
    return Telemetry(values)


def _numbers(payload: bytes) -> dict[str, float]:
    if len(payload) > LARGEST:
        raise BadRaMessage(f"{len(payload)} bytes, more than the {LARGEST} of a sketch")
    try:
        found = _decoder.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadRaMessage(f"no JSON object of numbers: {_shown(payload)}: {error}") from error
    named = ((name[:1].lower() + name[1:], value) for name, value in found.items() if value is not None)
    return {name: float(value) for name, value in named if math.isfinite(value)}


def _shown(payload: bytes) -> str:
    return repr(payload[:40].decode("utf-8", "replace"))
