"""`gemelo request`: the table of requests, calling one, and watching what is asked and answered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from schemas.message import Message
from schemas.topics import ACTIONS, DEVICE_COMMAND, REQUESTS, Request
from services.cli.errors import ExitCode, unknown
from services.cli.field_path import FieldPath
from services.cli.messages import dump, message_of
from services.cli.node import information_of, living
from services.cli.parser import Choices, Options, Parser, positive_integer
from services.cli.session import Session, connect, share_control
from services.cli.text_table import table
from services.cli.topic import echo, json_line, yaml_document
from services.recordings.table import exchanges_of, goal_request_of
from services.runtime.actions import keys

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


def echo_options(parser: Parser) -> None:
    """Adds request, count and --json."""
    parser.add_argument("request", metavar="REQUEST", help="a key of `gemelo request list`, or of a living node's own")
    count = parser.add_mutually_exclusive_group()
    count.add_argument("--once", dest="count", action="store_const", const=1, help="the first one only")
    count.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N answers")
    parser.add_argument("--json", action="store_true", help="a JSON value per line")


def run_echo(options: Options) -> ExitCode:
    """Prints each question with its answer, until Ctrl-C."""
    form = json_line if options.json else yaml_document
    with connect() as session:
        exchanges = exchanges_of(asked_on(session, options.request))
        return echo(session, exchanges, FieldPath(exchanges.message, ""), form, options.count)


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


def asked_on(session: Session, name: str) -> Request[Any, Any]:
    """The request of that key, of our table or of a living node; raises `CommandError` with the nearest key."""
    key = name.strip("/")
    for request in REQUESTS:
        if request.key == key:
            return request
    others = {each: node for node in living(session) for each in information_of(session, node).serves}
    if key not in others:
        raise unknown("request", name, [*(request.key for request in REQUESTS), *others])
    for action in ACTIONS:
        if key == keys.goal_request(action).key:
            return goal_request_of(action)
    return Request(key, Message, Message, others[key], "")


def call(session: Session, request: Request[Message, Message], message: Message) -> ExitCode:
    """Sends `message` and prints the answer as YAML."""
    if request.key == DEVICE_COMMAND.key:
        share_control(session)
    print(dump(session.node.call(request, message, timeout=CALL_TIMEOUT)), end="")
    return ExitCode.OK
