"""Messages to payloads and back, refusing what is not what it claims to be, or is too large: THE place of both.

Whoever changes a state and publishes it encodes first (`encoded`): what cannot be sent is refused before anything has
changed.
"""

from __future__ import annotations

from typing import Generic, TypeVar

import msgspec

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.camera import CameraImage
from gemelo.schemas.device import GatewayInputs
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.message import BadMessage, Message, decode, encode
from gemelo.schemas.planning import PlanRequest, PlanResponse
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import PlanningScene, SceneMesh, SceneRequest
from gemelo.schemas.system import Exchange

M = TypeVar("M", bound=Message)

KILOBYTE, MEGABYTE = 1024, 1024 * 1024
MAX_PAYLOAD = 512 * KILOBYTE  # the least limit: of all that is neither a list of points nor a file nor an image
TRAJECTORY = 32 * MEGABYTE  # the 100,000 points that the gateway takes, of eight joints, are 28
MAX_PAYLOAD_OF: dict[str, int] = {  # [bytes]
    RobotDescription.__name__: 8 * MEGABYTE,  # URDF text
    CameraImage.__name__: 8 * MEGABYTE,  # 1920 x 1080 in rgb8 is 6.2 million
    PlanRequest.__name__: 8 * MEGABYTE,  # 10,000 goals on the way, of eight joints, are 2
    PlanResponse.__name__: TRAJECTORY,
    GoalRequest.__name__: TRAJECTORY,
    SceneRequest.__name__: TRAJECTORY,  # the file of a mesh: 500,000 triangles are 25
    SceneMesh.__name__: TRAJECTORY,
    PlanningScene.__name__: 4 * MEGABYTE,  # 1,000 objects, without the files of their meshes
    GatewayInputs.__name__: TRAJECTORY + 2 * MEGABYTE,  # the largest goal, and all that has come beside it
    Exchange.__name__: TRAJECTORY + 9 * MEGABYTE,  # a question, its answer (one of them is small), and who asked
}
LARGEST = max(MAX_PAYLOAD_OF.values())
REMEDY_OF: dict[str, str] = {  # the code
    PlanRequest.__name__: "plan_in_parts",
    PlanResponse.__name__: "plan_in_parts",
    GoalRequest.__name__: "trajectory_in_parts",
    SceneRequest.__name__: "add_one_by_one",
    SceneMesh.__name__: "simplify_mesh",
    PlanningScene.__name__: "fewer_objects",
    RobotDescription.__name__: "simplify_urdf",
    CameraImage.__name__: "smaller_image",
}
ANY_REMEDY = "in_parts"


class TooLarge(ReasonedError, BadMessage):
    """A message that no receiver would take; the reason has its size, the limit and the remedy."""

    def __init__(self, schema: str, size: int, limit: int) -> None:
        """`size` and `limit` [bytes]."""
        what = remedy(REMEDY_OF.get(schema, ANY_REMEDY))
        super().__init__(because("message.too_large", what, message=schema, size=size, limit=limit))
        self.size, self.limit = size, limit


class Encoded(msgspec.Struct, Generic[M], frozen=True):
    """A message that can be sent, as it travels: its encoding cannot fail any more."""

    message: M
    payload: bytes


def schema_of(kind: type[Message]) -> str:
    """The name under which a message travels."""
    return kind.__name__


def encoded(message: M | Encoded[M]) -> Encoded[M]:
    """The message with its payload, which is made once; raises `TooLarge` where a receiver would refuse the size."""
    return message if isinstance(message, Encoded) else Encoded(message, to_payload(message))


def to_payload(message: Message) -> bytes:
    """Raises `TooLarge` where a receiver would refuse the size."""
    payload = encode(message)
    if len(payload) > MAX_PAYLOAD:
        _check_size(schema_of(type(message)), len(payload))
    return payload


def from_arrival(kind: type[M], arrival: Arrival) -> M:
    """The message; raises `BadMessage` for another schema, a payload too large, or one that does not decode."""
    if arrival.schema != kind.__name__:
        raise BadMessage(f'schema "{arrival.schema}" where {schema_of(kind)} is spoken')
    if len(arrival.payload) > MAX_PAYLOAD:
        _check_size(arrival.schema, len(arrival.payload))
    return decode(kind, arrival.payload)


def limit_of(schema: str) -> int:
    """[bytes] that a message of this schema may have."""
    return MAX_PAYLOAD_OF.get(schema, MAX_PAYLOAD)


def _check_size(schema: str, size: int) -> None:
    limit = limit_of(schema)
    if size > limit:
        raise TooLarge(schema, size, limit)
