"""Messages to payloads and back, refusing what is not what it claims to be."""

from __future__ import annotations

from typing import TypeVar

from schemas.camera import CameraImage
from schemas.device import GatewayInputs
from schemas.frames import RobotDescription
from schemas.message import BadMessage, Message, decode, encode
from schemas.system import Exchange
from services.runtime.bus.interface import Arrival

M = TypeVar("M", bound=Message)

MAX_PAYLOAD = 512 * 1024  # [bytes] a trajectory of 6 joints and 2,000 points is half of this
MAX_PAYLOAD_OF: dict[str, int] = {  # [bytes]
    RobotDescription.__name__: 8 * 1024 * 1024,  # URDF text
    GatewayInputs.__name__: 2 * 1024 * 1024,  # the largest goal, and all that has come beside it
    CameraImage.__name__: 8 * 1024 * 1024,  # 1920 x 1080 in rgb8 is 6.2 million
    Exchange.__name__: 2 * MAX_PAYLOAD + 64 * 1024,  # a question, its answer, and who asked
}


def schema_of(kind: type[Message]) -> str:
    """The name under which a message travels."""
    return kind.__name__


def to_payload(message: Message) -> bytes:
    """Raises `BadMessage` where a receiver would refuse the size."""
    payload = encode(message)
    _check_size(type(message), len(payload))
    return payload


def from_arrival(kind: type[M], arrival: Arrival) -> M:
    """The message; raises `BadMessage` for another schema, a payload too large, or one that does not decode."""
    if arrival.schema != schema_of(kind):
        raise BadMessage(f'schema "{arrival.schema}" where {schema_of(kind)} is spoken')
    _check_size(kind, len(arrival.payload))
    return decode(kind, arrival.payload)


def _check_size(kind: type[Message], size: int) -> None:
    limit = MAX_PAYLOAD_OF.get(schema_of(kind), MAX_PAYLOAD)
    if size > limit:
        raise BadMessage(f"{size} bytes: a {schema_of(kind)} has at most {limit}")
