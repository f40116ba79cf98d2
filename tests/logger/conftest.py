"""Messages as a moving arm gives them, for the logger."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from gemelo.schemas.device import CommandAck, CommandChunk

JOINTS = ("brazo_joint", "antebrazo_joint", "efector_joint")
START = 1_795_000_000_000_000_000


def _chunk(seq: int, stream: int = 7, knots: int = 5) -> CommandChunk:
    steps = tuple(tuple(256 * (seq * knots + knot) + joint for joint in range(3)) for knot in range(knots))
    motion = tuple(tuple(value / 1000 for value in row) for row in steps)
    return CommandChunk(
        stamp=START + seq * 100_000_000, stream=stream, seq=seq, name=JOINTS, dt=0.02, time=seq * knots * 0.02,
        position=motion, velocity=motion, acceleration=motion, steps=steps, step_rate=steps,
    )  # fmt: skip


def _ack(seq: int, stream: int = 7, code: int = 0) -> CommandAck:
    stamp = START + seq * 100_000_000 + 3_250_000
    return CommandAck(
        stamp=stamp, stream=stream, seq=seq, code=code, next_seq=seq + 1, round_trip=0.00325, steps=(seq, 2, 3)
    )


@pytest.fixture
def chunk() -> Callable[..., CommandChunk]:
    """chunk(seq, stream=7, knots=5) as the gateway publishes it."""
    return _chunk


@pytest.fixture
def ack() -> Callable[..., CommandAck]:
    """ack(seq, stream=7, code=0) 3.25 ms after its chunk."""
    return _ack
