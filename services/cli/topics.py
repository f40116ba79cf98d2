"""`gemelo topic`: the table of keys, and what passes on them. The wire says its type, so nobody has to."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import msgspec

from schemas.message import Message
from schemas.topics import ACTIONS, REQUESTS, TOPICS, Action, Request, Topic
from services.cli.columns import table
from services.cli.exits import CommandError, ExitCode, usage
from services.cli.names import nearest, unknown
from services.cli.rate import RateWindow
from services.cli.yaml import dump

if TYPE_CHECKING:
    from services.cli.session import Session

CALL_TIMEOUT = 5.0  # [s]
HZ_EVERY = 1.0  # [s] between two reports


def topic_of(name: str) -> Topic[Message]:
    """The row of the table; `/joint_states` will do too."""
    for topic in TOPICS:
        if topic.key == name.strip("/"):
            return topic
    raise unknown("topic", name, [topic.key for topic in TOPICS])


def listing() -> str:
    """All topics."""
    rows = [
        (topic.key, topic.message.__name__, rate_of(topic), topic.delivery.value, topic.writer, topic.about)
        for topic in TOPICS
    ]
    return table(("topic", "message", "rate [Hz]", "delivery", "writer", "about"), rows)


def requests() -> str:
    """All requests."""
    rows = [(r.key, r.request.__name__, r.response.__name__, r.server, r.about) for r in REQUESTS]
    return table(("request", "asked with", "answered with", "server", "about"), rows)


def actions() -> str:
    """All actions."""
    rows = [(a.key, a.goal.__name__, a.feedback.__name__, a.result.__name__, a.server, a.about) for a in ACTIONS]
    return table(("action", "goal", "feedback", "result", "server", "about"), rows)


def action_of(name: str) -> Action[Message, Message, Message]:
    """The row of the table."""
    for action in ACTIONS:
        if action.key == name.strip("/"):
            return action
    raise unknown("action", name, [action.key for action in ACTIONS])


def action_information(action: Action[Message, Message, Message]) -> str:
    """One action and the fields of its three messages."""
    parts = {"goal": action.goal, "feedback": action.feedback, "result": action.result}
    fields = {part: {"message": kind.__name__, "fields": fields_of(kind)} for part, kind in parts.items()}
    return dump({"action": action.key, "about": action.about, "server": action.server, **fields})


def request_of(name: str) -> Request[Message, Message]:
    """The row of the table."""
    for request in REQUESTS:
        if request.key == name.strip("/"):
            return request
    raise unknown("request", name, [request.key for request in REQUESTS])


def call(session: Session, request: Request[Message, Message], message: Message) -> ExitCode:
    """Asks, and prints the answer as YAML."""
    print(dump(session.node.call(request, message, timeout=CALL_TIMEOUT)), end="")
    return ExitCode.OK


def rate_of(topic: Topic[Message]) -> str:
    return "-" if topic.rate is None else f"{topic.rate:g}"


def information(topic: Topic[Message]) -> str:
    """One topic and the fields of its message."""
    head = {
        "topic": topic.key, "about": topic.about, "message": topic.message.__name__, "rate_hz": topic.rate,
        "delivery": topic.delivery.value, "recorded": topic.recorded, "writer": topic.writer,
    }  # fmt: skip
    return dump({**head, "fields": fields_of(topic.message)})


def fields_of(message: type[Message]) -> dict[str, str]:
    """Field names and their types as written in `schemas`."""
    return {field.name: str(message.__annotations__.get(field.name, "")) for field in msgspec.structs.fields(message)}


def echo(session: Session, topic: Topic[Message], count: int | None, as_json: bool) -> ExitCode:
    """Prints messages as they come, until Ctrl-C or `count` of them."""
    printed = 0

    def on_message(message: Message) -> None:
        nonlocal printed
        if count is not None and printed >= count:
            return
        printed += 1
        print(msgspec.json.encode(message).decode() if as_json else f"{dump(message)}---", flush=True)
        if printed == count:
            session.node.stop()

    return _listen(session, topic, on_message)


def hz(session: Session, topic: Topic[Message], window: int, count: int | None) -> ExitCode:
    """Prints the rate of arrival once a second, until Ctrl-C or `count` reports."""
    arrivals = RateWindow(window)
    reports, heard, last = 0, 0, session.node.monotonic()

    def on_message(message: Message) -> None:
        arrivals.add(session.node.monotonic())

    def step(now: int) -> None:
        nonlocal reports, heard, last
        if session.node.monotonic() - last < HZ_EVERY:
            return
        last = session.node.monotonic()
        report = arrivals.report() if arrivals.total > heard else None
        print(report or f"no new messages on {topic.key}", flush=True)
        heard = arrivals.total
        reports += 1
        if reports == count:
            session.node.stop()

    return _listen(session, topic, on_message, step)


def _listen(
    session: Session,
    topic: Topic[Any],
    on_message: Callable[[Message], None],
    step: Callable[[int], None] = lambda now: None,
) -> ExitCode:
    session.node.subscribe(topic, on_message)
    session.node.spin(step, rate=50.0)
    return ExitCode.OK


def publish(
    session: Session, topic: Topic[Message], message: Message, rate: float | None, count: int | None
) -> ExitCode:
    """Publishes once, `count` times, or at `rate` [Hz] until Ctrl-C."""
    if topic.writer != "any":
        raise CommandError(
            f"refused: only {topic.writer} writes {topic.key}; another writer would deceive every reader"
        )
    publisher = session.node.publisher(topic)
    remaining = count if count is not None else (1 if rate is None else None)
    sent = 0

    def step(now: int) -> None:
        nonlocal sent
        publisher.put(stamped(message, now))
        sent += 1
        if remaining is not None and sent >= remaining:
            session.node.stop()

    session.node.wait(0.3)  # until the readers are known
    session.node.spin(step, rate=rate or 1.0)
    print(f"published {sent} x {topic.message.__name__} on {topic.key}")
    return ExitCode.OK


def stamped(message: Message, now: int) -> Message:
    """The message with the present time, where it has a stamp that was not given."""
    if getattr(message, "stamp", None) == 0:
        return msgspec.structs.replace(message, stamp=now)
    return message


def message_of(kind: type[Message], text: str) -> Any:
    """`text` (JSON) as a `kind`; an unknown field is a mistake of the writer here, so it is refused."""
    try:
        raw = msgspec.json.decode(text)
        if not isinstance(raw, dict):
            raise usage(f'a {kind.__name__} is written as JSON, like {{"{kind.__struct_fields__[0]}": ...}}')
        for field in raw:
            if field not in kind.__struct_fields__:
                guess = nearest(field, kind.__struct_fields__)
                hint = f'did you mean "{guess}"?' if guess else f"it has {', '.join(kind.__struct_fields__)}"
                raise usage(f'{kind.__name__} has no field "{field}": {hint}')
        return msgspec.convert(raw, kind)
    except (msgspec.DecodeError, ValueError) as error:
        raise usage(f"not a {kind.__name__}: {error}") from error
