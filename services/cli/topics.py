"""`gemelo topic | request | action`: the tables of keys, and messages as a person writes them."""

from __future__ import annotations

from typing import Any

import msgspec

from schemas.message import Message
from schemas.topics import ACTIONS, REQUESTS, TOPICS, Action, Request, Topic
from services.cli.columns import table
from services.cli.exits import usage
from services.cli.names import nearest, unknown
from services.cli.yaml import dump


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
