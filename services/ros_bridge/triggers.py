"""The services ~/stop, ~/hold, ~/resume and ~/reset (std_srvs/Trigger)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from gemelo.libraries.ros2.types import encode, make, ros_type
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.names import RosType
from gemelo.libraries.runtime.ros_wire.ros_node import RosQuery
from gemelo.schemas.device import (
    DeviceCommand,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceStopRequest,
    ResetCommand,
    ResumeCommand,
    StopKind,
)
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.topics import DEVICE_COMMAND, DEVICE_STOP, Request

TRIGGER = "std_srvs/srv/Trigger"
TO_ANSWER = 2.0  # [s] for the device
STOPS = {"stop": StopKind.STOP, "hold": StopKind.HOLD}
COMMANDS: dict[str, DeviceCommand] = {"resume": ResumeCommand(), "reset": ResetCommand()}

Q = TypeVar("Q", bound=Message)


class Serving(Protocol):
    """A node of ROS 2, as far as services need it."""

    def serve(self, name: str, kind: RosType, on_query: Callable[[RosQuery], None]) -> None: ...


def serve_triggers(node: Node, ros: Serving, motion: bool) -> None:
    """A stop is always passed on; what lets the arm move again only with `motion`.

    A stop over ROS is a request like others, behind the router of ROS: the page and `gemelo stop` are the safe way.
    """
    for name, kind in STOPS.items():
        ros.serve(f"~/{name}", ros_type(TRIGGER), _asking(node, DEVICE_STOP, DeviceStopRequest(kind=kind)))
    for name, command in COMMANDS.items():
        asked = _asking(node, DEVICE_COMMAND, DeviceCommandRequest(command=command))
        ros.serve(f"~/{name}", ros_type(TRIGGER), asked if motion else _refuse)


def _refuse(query: RosQuery) -> None:
    query.reply(triggered(False, str(because("ros.motion.off", remedy("ros_motion")))))


def _asking(node: Node, request: Request[Q, DeviceCommandResponse], question: Q) -> Callable[[RosQuery], None]:
    """What replies to a query with the device's answer, and holds nothing up meanwhile."""

    def on_query(query: RosQuery) -> None:
        def answer() -> None:
            try:
                response = pending.response()
            except (RequestRefused, NoAnswer) as error:
                query.reply(triggered(False, str(error)))
            else:
                query.reply(triggered(response.accepted, str(response.why or response.reason)))

        pending = node.ask_at_once(request, question, TO_ANSWER, lambda: node.post(answer))

    return on_query


def triggered(success: bool, message: str) -> bytes:
    """The response of std_srvs/Trigger."""
    return encode(make(f"{TRIGGER}_Response", success=success, message=message))
