"""The topics of a recording: those of the table, and what requests and actions say, as the messages that it is.

On the bus a question, a goal or a result travels raw inside of another message, so that one class serves all of them.
A reader that knows the request or action takes a class of the same name and fields in which it is typed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import msgspec

from gemelo.libraries.recordings.living_topic import LivingTopic, living_topic
from gemelo.libraries.runtime.actions import keys
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.message import Message, Vector
from gemelo.schemas.system import NodeRecord
from gemelo.schemas.topics import ACTIONS, LATCHED, REQUESTS, TOPICS, Action, Request, Topic, exchange_topic

NODES = Topic("nodes", NodeRecord, LATCHED, None, True, "logger", "the nodes, their topics and their parameters")
PLAIN: dict[str, type] = {"bool": bool, "int": int, "float": float, "str": str}
LISTS: dict[str, Any] = {
    **{f"tuple[{name}, ...]": tuple[kind, ...] for name, kind in PLAIN.items()},  # type: ignore[valid-type]
    **{f"list[{name}]": tuple[kind, ...] for name, kind in PLAIN.items()},  # type: ignore[valid-type]
    "Vector": Vector,
}


def recorded_topics() -> tuple[Topic[Any], ...]:
    """Everything that is known to be recorded before any node has said a word."""
    rows = [topic for topic in TOPICS if topic.recorded]
    asked = [exchanges_of(request) for request in REQUESTS if request.recorded]
    return (*rows, *asked, *(topic for action in ACTIONS for topic in action_topics(action)), NODES)


def exchanges_of(request: Request[Any, Any]) -> Topic[Any]:
    """The questions and answers of a request; of one whose messages are not known (`Message`), whatever they are."""
    topic = exchange_topic(request)
    return _typed(topic, question=_known(request.request), answer=_known(request.response))


def action_topics(action: Action[Any, Any, Any]) -> tuple[Topic[Any], ...]:
    """The goals, cancels, feedback, results and statuses of an action."""
    return (
        exchanges_of(goal_request_of(action)),
        exchanges_of(keys.cancel_request(action)),
        _typed(keys.feedback_topic(action), feedback=_known(action.feedback)),
        _typed(keys.ended_topic(action), result=_known(action.result)),
        keys.status_topic(action),
    )


def goal_request_of(action: Action[Any, Any, Any]) -> Request[Any, Any]:
    """The request that brings a goal, with the goal as the action's own message."""
    request: Request[Any, Any] = keys.goal_request(action)
    return replace(request, request=_typed_message(GoalRequest, goal=_known(action.goal)))


def topics_of_node(record: NodeRecord) -> tuple[Topic[Any], ...]:
    """What a node says that `recorded_topics` does not have: topics, requests and actions of a user's own."""
    known = {topic.key for topic in recorded_topics()} | {topic.key for topic in TOPICS}
    requests = [Request(key, Message, Message, record.node, "") for key in record.info.serves]
    actions = [Action(key, Message, Message, Message, record.node, "") for key in record.info.actions]
    inner = {topic.key: topic for action in actions for topic in action_topics(action)}
    asked = {topic.key: topic for topic in map(exchanges_of, requests)}
    said = {each.key: living_topic(each) for each in record.topics if each.recorded and not each.key.startswith("@")}
    silent = {exchange_topic(keys.result_request(action)).key for action in actions}
    found = {**said, **asked, **inner}
    return tuple(found[key] for key in sorted(found.keys() - known - silent))


def described(topic: Topic[Any]) -> type[Message]:
    """The topic's message with types where its node has told them: for a schema, not for reading."""
    if not isinstance(topic, LivingTopic):
        return topic.message
    types = {name: PLAIN.get(text) or LISTS.get(text) or Any for name, text in topic.fields.items()}
    return _typed_message(topic.message, **types)


def _known(kind: type[Message]) -> Any:
    """`Message` itself stands for a class that only its node has."""
    return Any if kind is Message else kind | None


def _typed(topic: Topic[Any], **fields: Any) -> Topic[Any]:
    return replace(topic, message=_typed_message(topic.message, **fields))


def _typed_message(kind: type[Message], **types: Any) -> type[Message]:
    """A class of the same name and fields, some of which have other types and None for their default."""
    fields = [
        (each.name, types[each.name], None) if each.name in types else (each.name, each.type, each.default)
        for each in msgspec.structs.fields(kind)
    ]
    made = msgspec.defstruct(kind.__name__, fields, bases=(Message,), frozen=True, kw_only=True)
    return cast("type[Message]", made)
