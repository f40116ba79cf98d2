"""Inputs of the core, as values: the shell makes them of what arrives, and a replay reads them from a recording.

The core has no clock, no wire and no chance of its own, so the same inputs at the same moments give the same outputs.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from hashlib import blake2b

import msgspec

from gemelo.schemas.control import ControlGive, ControlJoin, ControlTake
from gemelo.schemas.device import DeviceCommandRequest, DeviceStopRequest, InjectRequest
from gemelo.schemas.gripper import GripperCommandGoal
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import StreamVerdict
from gemelo.schemas.reasons import Reason
from gemelo.services.stepper_gateway.goals.goal_executor import CancelVerdict, GoalVerdict
from gemelo.services.stepper_gateway.ledger.confidence import LedgerRecord
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer, GoalFinished, GripperFinished, Output, Publish
from gemelo.services.stepper_gateway.parameters import GatewayParameters

LARGEST = 64 * 1024 * 1024  # [B] of one message's inputs, unpacked; chosen: far beyond half a second of them


class _Input(msgspec.Struct, frozen=True, tag=lambda name: name.removesuffix("Input"), array_like=True):
    """The base of every input; a recording names it without "Input"."""


class BeganInput(_Input, frozen=True):
    """The core was made; `kept` is the step ledger of the gateway before."""

    session: int
    parameters: GatewayParameters
    kept: LedgerRecord | None = None
    has_rest_rate: bool = False  # of recordings before that parameter, whose core published every state
    has_readings_rest_rate: bool = False  # the same of the parameter `readings_rest_rate`
    has_watch: bool = False  # of recordings before the parameter `watch_streams`, whose core watched none


class ParametersInput(_Input, frozen=True):
    """Other parameters were set."""

    parameters: GatewayParameters


class StepInput(_Input, frozen=True):
    """One turn of the control loop."""

    absences: dict[str, float] = {}  # [s] of liveliness tokens, by key


class LinkInput(_Input, frozen=True):
    """How the wire is, whenever something has happened on it."""

    connected: bool
    reason: str
    why: Reason | None = None  # `reason` as data


def link_input(connected: bool, why: Reason | None) -> LinkInput:
    """How the wire is; `why` it is not connected."""
    return LinkInput(connected, str(why or ""), why)


class FrameInput(_Input, frozen=True):
    """One payload from the device."""

    kind: Kind
    payload: bytes
    retained: bool
    arrival: int  # [ns] monotonic clock


class GoalInput(_Input, frozen=True):
    goal_id: str
    goal: FollowJointTrajectoryGoal
    session: str = ""  # that asks, here and in the next ones


class CancelInput(_Input, frozen=True):
    goal_id: str


class GripInput(_Input, frozen=True):
    goal_id: str
    goal: GripperCommandGoal
    session: str = ""


class GripCancelInput(_Input, frozen=True):
    goal_id: str


class SceneInput(_Input, frozen=True):
    """All of a scene that the gateway looks at."""

    version: int
    epoch: int
    instance: str = ""  # of the planner that has published it


class PlannerInput(_Input, frozen=True):
    """A process that bears the planner's name has come or gone."""

    instance: str
    is_there: bool


class NewcomerInput(_Input, frozen=True):
    """A node has come, which may read what rests."""


class TargetsInput(_Input, frozen=True):
    targets: JointTargets
    node: str = ""  # that they come from
    watched: bool = False  # the planner has looked at their way already


class VerdictInput(_Input, frozen=True):
    """The planner's answer to a path of streamed targets."""

    verdict: StreamVerdict


class CommandInput(_Input, frozen=True):
    ticket: int
    request: DeviceCommandRequest
    session: str = ""


class StopInput(_Input, frozen=True):
    ticket: int
    request: DeviceStopRequest


class ConfigureInput(_Input, frozen=True):
    ticket: int
    session: str = ""


class InjectInput(_Input, frozen=True):
    ticket: int
    request: InjectRequest


class EchoInput(_Input, frozen=True):
    ticket: int


class TakeControlInput(_Input, frozen=True):
    """Its secret is sealed, as in the next two: who reads the recording cannot use it."""

    ticket: int
    request: ControlTake
    session: str


class JoinControlInput(_Input, frozen=True):
    ticket: int
    request: ControlJoin
    session: str


class GiveControlInput(_Input, frozen=True):
    ticket: int
    request: ControlGive


Input = (
    BeganInput | ParametersInput | StepInput | LinkInput | FrameInput | GoalInput | CancelInput | GripInput
    | GripCancelInput | SceneInput | PlannerInput | TargetsInput | VerdictInput | CommandInput | StopInput
    | ConfigureInput | InjectInput | EchoInput | NewcomerInput | TakeControlInput | JoinControlInput | GiveControlInput
)  # fmt: skip
Reply = GoalVerdict | CancelVerdict | None  # what is answered at once


class Given(msgspec.Struct, frozen=True, array_like=True):
    """One input, the moment at which the core was given it, and what came of it."""

    unix: int  # [ns]
    monotonic: float  # [s]
    digest: int  # of the outputs: `digest_of`
    input: Input

    @property
    def moment(self) -> Moment:
        return Moment(self.unix, self.monotonic)


def digest_of(reply: Reply, outputs: list[Output]) -> int:
    """BLAKE2 of everything but the messages for the bus, which a recording has: frames, results, answers, log lines.

    0 where there is none. No CRC-32: that of a frame which ends with its own CRC-32 is the same for every content.
    """
    said = [] if reply is None else [msgspec.msgpack.encode(_without_reason(reply))]
    for output in outputs:
        if type(output) is not Publish:
            said += (type(output).__name__.encode(), _encoded(output))
    return int.from_bytes(blake2b(b"".join(said), digest_size=8).digest(), "big") if said else 0


def _without_reason(reply: GoalVerdict | CancelVerdict) -> tuple[bool, int, str] | str:
    """Its sentence alone, as recordings from before the reasons have it; the sentence is made of the reason."""
    return reply[:3] if isinstance(reply, GoalVerdict) else str(reply.why or "")


def _encoded(output: Output) -> bytes:
    if not isinstance(output, GoalFinished | GripperFinished | Answer):
        return msgspec.msgpack.encode(output)
    fields = msgspec.to_builtins(output)
    fields["response" if isinstance(output, Answer) else "result"].pop("why", None)
    return msgspec.msgpack.encode(fields)


_decoder = msgspec.msgpack.Decoder(list[Given])


def packed(encoded: list[bytes]) -> bytes:
    """Inputs, each as msgpack, as a message carries them."""
    count = len(encoded)
    return zlib.compress(b"\xdd" + count.to_bytes(4, "big") + b"".join(encoded), 1)  # an array of msgpack


def unpacked(payload: bytes) -> Iterator[Given]:
    """Raises ValueError for what is no list of inputs."""
    unzip = zlib.decompressobj()
    try:
        content = unzip.decompress(payload, LARGEST)
    except zlib.error as error:
        raise ValueError(f"{error}") from error
    yield from _decoder.decode(content)
