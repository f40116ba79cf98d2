"""The table of keys: no key twice, every writer known, every row says what it is."""

from __future__ import annotations

import re

from gemelo.schemas.message import Message
from gemelo.schemas.topics import ACTIONS, CAMERA_TOPICS, REQUESTS, TOPICS, Action, Delivery, Request, Topic
from tests.schemas.samples import messages
from tests.table import table

WRITERS = {"stepper_gateway", "state_publisher", "planner", "logger", "visualizer", "camera", "detector", "any"}
Row = Topic[Message] | Request[Message, Message] | Action[Message, Message, Message]
OF_A_CAMERA: tuple[Topic[Message], ...] = tuple(of("webcam") for of in CAMERA_TOPICS)
ROWS: tuple[Row, ...] = (*TOPICS, *OF_A_CAMERA, *REQUESTS, *ACTIONS)


def test_no_key_stands_twice() -> None:
    keys = [row.key for row in ROWS]
    assert len(keys) == len(set(keys))


@table("row", ROWS, ids=lambda row: row.key)
def test_every_row_has_a_plain_key_a_known_writer_and_a_sentence(row: Row) -> None:
    assert re.fullmatch(r"[a-z][a-z_]*(/[a-z][a-z_]*)*", row.key)
    assert (row.writer if isinstance(row, Topic) else row.server) in WRITERS
    assert row.about


@table("topic", [*TOPICS, *OF_A_CAMERA], ids=lambda topic: topic.key)
def test_only_what_may_be_dropped_has_a_rate(topic: Topic[Message]) -> None:
    assert topic.rate is None or topic.rate > 0.0
    assert topic.rate is None or topic.delivery is Delivery.LATEST


def test_every_message_of_the_table_is_one_of_ours() -> None:
    known = set(messages())
    for row in ROWS:
        match row:
            case Topic():
                assert row.message in known
            case Request():
                assert {row.request, row.response} <= known
            case Action():
                assert {row.goal, row.feedback, row.result} <= known


def test_names_of_messages_are_unique() -> None:
    """The name travels in the encoding: it must say which message it is."""
    names = [kind.__name__ for kind in messages()]
    assert len(names) == len(set(names))
