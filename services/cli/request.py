"""`gemelo request`: the table of requests, and calling one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schemas.message import Message
from schemas.topics import REQUESTS, Request
from services.cli.errors import ExitCode, unknown
from services.cli.messages import dump, message_of
from services.cli.parser import Choices, Options, Parser
from services.cli.session import Session, connect
from services.cli.text_table import table

if TYPE_CHECKING:
    from gemelo import Robot

CALL_TIMEOUT = 5.0  # [s]


def run_list(options: Options) -> ExitCode:
    """Prints the table of requests."""
    print(listing())
    return ExitCode.OK


def call_options(parser: Parser) -> None:
    """Adds request and message."""
    parser.add_argument("request", metavar="REQUEST", help="a key of `gemelo request list`")
    parser.add_argument("message", metavar="JSON", nargs="?", default="{}", help="what is asked")


def run_call(options: Options) -> ExitCode:
    """Calls a request."""
    request = request_of(options.request)
    message = message_of(request.request, options.message)
    with connect() as session:
        return call(session, request, message)


def choices(robot: Robot | None) -> Choices:
    """The requests."""
    return {"": [request.key for request in REQUESTS]}


def listing() -> str:
    """The table of all requests."""
    rows = [(r.key, r.request.__name__, r.response.__name__, r.server, r.about) for r in REQUESTS]
    return table(("request", "asked with", "answered with", "server", "about"), rows)


def request_of(name: str) -> Request[Message, Message]:
    """The request of that name; raises `CommandError` with the nearest name."""
    for request in REQUESTS:
        if request.key == name.strip("/"):
            return request
    raise unknown("request", name, [request.key for request in REQUESTS])


def call(session: Session, request: Request[Message, Message], message: Message) -> ExitCode:
    """Sends `message` and prints the answer as YAML."""
    print(dump(session.node.call(request, message, timeout=CALL_TIMEOUT)), end="")
    return ExitCode.OK
