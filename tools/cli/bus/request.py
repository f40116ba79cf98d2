"""`gemelo request`: the table of requests, calling one, and watching what is asked and answered."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gemelo.libraries.recordings.table import exchanges_of, goal_request_of
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.message import Message
from gemelo.schemas.topics import ACTIONS, DEVICE_COMMAND, REQUESTS, Request
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.bus.messages import dump, message_of
from gemelo.tools.cli.bus.node import information_of, living
from gemelo.tools.cli.bus.topic import echo
from gemelo.tools.cli.common.errors import ExitCode, unknown
from gemelo.tools.cli.common.forms import count_options, form_of, form_options, print_value, yaml_document
from gemelo.tools.cli.common.language import columns, translated
from gemelo.tools.cli.common.session import CommandSession, connect, share_control
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option

if TYPE_CHECKING:
    from gemelo import Robot

CALL_TIMEOUT = 5.0  # [s]


def run_list(options: Options) -> ExitCode:
    """Prints the table of requests."""
    rows = [
        {"request": r.key, "asked_with": r.request.__name__, "answered_with": r.response.__name__, "server": r.server,
         "about": r.about} for r in REQUESTS
    ]  # fmt: skip
    return print_value(rows, options.json, listing)


def call_options(parser: Parser) -> None:
    """Adds request, message and --json."""
    json_option(parser)
    parser.add_argument("request", metavar="REQUEST", help="a key of `gemelo request list`")
    parser.add_argument("message", metavar="JSON", nargs="?", default="{}", help="what is asked")


def run_call(options: Options) -> ExitCode:
    """Calls a request."""
    request = request_of(options.request)
    message = message_of(request.request, options.message)
    with connect() as session:
        return call(session, request, message, options.json)


def echo_options(parser: Parser) -> None:
    """Adds request with field, count and form."""
    about = "a key of `gemelo request list`, or of a living node's own, and a field, as plan.answer.refusal"
    parser.add_argument("request", metavar="REQUEST[.FIELD]", help=about)
    count_options(parser, "answers")
    form_options(parser)


def run_echo(options: Options) -> ExitCode:
    """Prints each question with its answer, until Ctrl-C."""
    key, _, path = options.request.partition(".")
    form = form_of(options, yaml_document)
    with connect() as session:
        exchanges = exchanges_of(asked_on(session, key))
        return echo(session, exchanges, FieldPath(exchanges.message, path), form, options.count)


def choices(robot: Robot | None) -> Choices:
    """The requests."""
    return {"": [request.key for request in REQUESTS]}


def listing() -> str:
    """The table of all requests."""
    rows = [(r.key, r.request.__name__, r.response.__name__, r.server, translated(r.about)) for r in REQUESTS]
    return table(columns("request", "asked with", "answered with", "server", "about"), rows)


def request_of(name: str) -> Request[Message, Message]:
    """The request of that name; raises `CommandError` with the nearest name."""
    for request in REQUESTS:
        if request.key == name.strip("/"):
            return request
    raise unknown("request", name, [request.key for request in REQUESTS])


def asked_on(session: CommandSession, name: str) -> Request[Any, Any]:
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


def call(
    session: CommandSession, request: Request[Message, Message], message: Message, as_json: bool = False
) -> ExitCode:
    """Sends `message` and prints the answer as YAML or JSON."""
    if request.key == DEVICE_COMMAND.key:
        share_control(session)
    answer = session.node.call(request, message, timeout=CALL_TIMEOUT)
    return print_value(answer, as_json, lambda: dump(answer))
