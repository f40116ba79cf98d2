"""What goes between the planner's process and its workers: messages behind their length, over pipes."""

from __future__ import annotations

import struct
from typing import IO, TypeVar

import msgspec

from schemas.joints import JointState
from schemas.planning import PlanRequest
from schemas.scene import PlanningScene

T = TypeVar("T")
LENGTH = struct.Struct("<I")


class Job(msgspec.Struct, frozen=True, kw_only=True):
    """One plan; `scene` is there where the worker does not have it yet."""

    request: PlanRequest
    present: JointState | None = None
    age: float = 0.0  # [s] of `present`
    scene: PlanningScene | None = None


class Ready(msgspec.Struct, frozen=True):
    """The worker's first word: from now on it plans."""


def send(pipe: IO[bytes], message: msgspec.Struct) -> None:
    """Writes one message; raises OSError where nobody reads any more."""
    content = msgspec.msgpack.encode(message)
    pipe.write(LENGTH.pack(len(content)) + content)
    pipe.flush()


def receive(pipe: IO[bytes], kind: type[T]) -> T:
    """Waits for one message; raises `EOFError` where the other side has ended."""
    (length,) = LENGTH.unpack(_exactly(pipe, LENGTH.size))
    return msgspec.msgpack.decode(_exactly(pipe, length), type=kind)


def _exactly(pipe: IO[bytes], size: int) -> bytes:
    content = pipe.read(size)
    if len(content) < size:
        raise EOFError("the other side has ended")
    return content
