"""`gemelo topic`: the table of topics, and the messages that pass on the bus."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import msgspec

from schemas.message import Message
from schemas.topics import TOPICS, Topic
from services.cli.errors import CommandError, ExitCode, unknown
from services.cli.messages import dump, fields_of, message_of
from services.cli.parser import Choices, Options, Parser, positive_integer, positive_number
from services.cli.session import Session, connect
from services.cli.text_table import table

if TYPE_CHECKING:
    from gemelo import Robot

HZ_EVERY = 1.0  # [s] between two reports


def run_list(options: Options) -> ExitCode:
    """Prints the table of topics."""
    print(listing())
    return ExitCode.OK


def topic_option(parser: Parser) -> None:
    """Adds the topic."""
    parser.add_argument("topic", metavar="TOPIC", help="a key of `gemelo topic list`")


def run_info(options: Options) -> ExitCode:
    """Prints one topic."""
    print(information(topic_of(options.topic)), end="")
    return ExitCode.OK


def echo_options(parser: Parser) -> None:
    """Adds topic, count and --json."""
    topic_option(parser)
    count = parser.add_mutually_exclusive_group()
    count.add_argument("--once", dest="count", action="store_const", const=1, help="the first one only")
    count.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N messages")
    parser.add_argument("--json", action="store_true", help="a JSON object per line")


def run_echo(options: Options) -> ExitCode:
    """Prints the messages of a topic."""
    topic = topic_of(options.topic)
    with connect() as session:
        return echo(session, topic, options.count, options.json)


def hz_options(parser: Parser) -> None:
    """Adds topic, window and count."""
    topic_option(parser)
    parser.add_argument("-w", "--window", type=positive_integer, default=10_000, metavar="N", help="messages averaged")
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N reports")


def run_hz(options: Options) -> ExitCode:
    """Prints the rate of a topic."""
    topic = topic_of(options.topic)
    with connect() as session:
        return hz(session, topic, options.window, options.count)


def pub_options(parser: Parser) -> None:
    """Adds topic, message, rate and count."""
    topic_option(parser)
    parser.add_argument("message", metavar="JSON", help="an empty stamp becomes the present time")
    parser.add_argument("-r", "--rate", type=positive_number, metavar="HZ", help="again and again, until Ctrl-C")
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N messages")


def run_publish(options: Options) -> ExitCode:
    """Publishes on a topic."""
    topic = topic_of(options.topic)
    message = message_of(topic.message, options.message)
    with connect() as session:
        return publish(session, topic, message, options.rate, options.count)


def choices(robot: Robot | None) -> Choices:
    """The topics."""
    return {"": [topic.key for topic in TOPICS]}


def topic_of(name: str) -> Topic[Message]:
    """The topic of that name, with or without a leading slash; raises `CommandError` with the nearest name."""
    for topic in TOPICS:
        if topic.key == name.strip("/"):
            return topic
    raise unknown("topic", name, [topic.key for topic in TOPICS])


def listing() -> str:
    """The table of all topics."""
    rows = [
        (topic.key, topic.message.__name__, rate_of(topic), topic.delivery.value, topic.writer, topic.about)
        for topic in TOPICS
    ]
    return table(("topic", "message", "rate [Hz]", "delivery", "writer", "about"), rows)


def rate_of(topic: Topic[Message]) -> str:
    """The rate [Hz] as text."""
    return "-" if topic.rate is None else f"{topic.rate:g}"


def information(topic: Topic[Message]) -> str:
    """One topic and the fields of its message as YAML."""
    head = {
        "topic": topic.key, "about": topic.about, "message": topic.message.__name__, "rate_hz": topic.rate,
        "delivery": topic.delivery.value, "recorded": topic.recorded, "writer": topic.writer,
    }  # fmt: skip
    return dump({**head, "fields": fields_of(topic.message)})


class RateWindow:
    """Arrival times [s, monotonic] of the last `size` messages."""

    def __init__(self, size: int = 10_000) -> None:
        self._times: deque[float] = deque(maxlen=size)
        self.total = 0  # messages ever seen

    def add(self, time: float) -> None:
        """Takes the arrival of a message at `time` [s, monotonic]."""
        self._times.append(time)
        self.total += 1

    def report(self) -> str | None:
        """Two lines in the form of `ros2 topic hz`; None after fewer than two messages."""
        if len(self._times) < 2:
            return None
        times = list(self._times)
        gaps = [after - before for before, after in pairwise(times)]
        mean = sum(gaps) / len(gaps)
        deviation = math.sqrt(sum((gap - mean) ** 2 for gap in gaps) / len(gaps))
        rate = 1.0 / mean if mean > 0.0 else math.inf
        return (
            f"average rate: {rate:.3f}\n"
            f"\tmin: {min(gaps):.3f}s max: {max(gaps):.3f}s std dev: {deviation:.5f}s window: {len(times)}"
        )


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
    """The message with the present time, if it has a stamp that is 0."""
    if getattr(message, "stamp", None) == 0:
        return msgspec.structs.replace(message, stamp=now)
    return message
