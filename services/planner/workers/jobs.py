"""Messages between the planner's process and its workers: each behind its length, over pipes."""

from __future__ import annotations

import struct
from typing import IO, TypeVar

import msgspec

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanPhase, PlanRequest, PlanResponse
from gemelo.schemas.scene import PlanningScene

T = TypeVar("T")
LENGTH = struct.Struct("<I")


class SetScene(msgspec.Struct, frozen=True, tag=True):
    """The scene of later plans: seconds of work where there is a large mesh, and none of a plan's time."""

    scene: PlanningScene


class Job(msgspec.Struct, frozen=True, kw_only=True, tag=True):
    """One plan."""

    request: PlanRequest
    present: JointState | None = None
    age: float = 0.0  # [s] of `present`


class CancelPlan(msgspec.Struct, frozen=True, tag=True):
    """The running plan is not needed any more; whatever answer it has by now will do."""


class PhaseQuestion(msgspec.Struct, frozen=True, tag=True):
    """A request for the phase of the running plan; a short plan is never asked, and so pays nothing for it."""


class Ready(msgspec.Struct, frozen=True, tag=True):
    """The worker's first word: from now on it plans."""


class SceneIsSet(msgspec.Struct, frozen=True, tag=True):
    """What is answered to `SetScene`."""


class PhaseReport(msgspec.Struct, frozen=True, tag=True):
    """What is answered to `PhaseQuestion`."""

    phase: PlanPhase


class Planned(msgspec.Struct, frozen=True, tag=True):
    """What is answered to `Job`."""

    response: PlanResponse


Order = SetScene | Job | CancelPlan | PhaseQuestion
Report = Ready | SceneIsSet | PhaseReport | Planned

ORDERS: msgspec.msgpack.Decoder[Order] = msgspec.msgpack.Decoder(Order)
REPORTS: msgspec.msgpack.Decoder[Report] = msgspec.msgpack.Decoder(Report)


def send(pipe: IO[bytes], message: Order | Report) -> None:
    """Writes one message; raises OSError where nobody reads any more."""
    content = msgspec.msgpack.encode(message)
    left = memoryview(LENGTH.pack(len(content)) + content)
    while left:
        left = left[pipe.write(left) :]
    pipe.flush()


def receive(pipe: IO[bytes], kind: msgspec.msgpack.Decoder[T]) -> T:
    """Waits for one message; raises `EOFError` where the other side has ended."""
    (length,) = LENGTH.unpack(_exactly(pipe, LENGTH.size))
    return kind.decode(_exactly(pipe, length))


def _exactly(pipe: IO[bytes], size: int) -> bytes:
    content = bytearray()
    while len(content) < size:
        more = pipe.read(size - len(content))
        if not more:
            raise EOFError("the other side has ended")
        content += more
    return bytes(content)
