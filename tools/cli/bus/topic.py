"""`gemelo topic`: the table of topics, and the messages that pass on the bus."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import msgspec

from gemelo.libraries.recordings.living_topic import LivingTopic
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import TOPICS, Topic
from gemelo.tools.cli.bus.field_path import FieldPath
from gemelo.tools.cli.bus.living_topics import all_topics, connected, known_topic, router_listens
from gemelo.tools.cli.bus.messages import dump, fields_of, message_of
from gemelo.tools.cli.bus.topic_ends import Ends, ends
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown
from gemelo.tools.cli.common.forms import Form, count_options, form_of, form_options, print_value, yaml_document
from gemelo.tools.cli.common.language import columns, sentence, translated
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Choices, Options, Parser, json_option, positive_integer, positive_number

if TYPE_CHECKING:
    from gemelo import Robot


def list_options(parser: Parser) -> None:
    """Adds -t and --json."""
    form = parser.add_mutually_exclusive_group()
    form.add_argument("-t", "--types", action="store_true", help="a line each: the key and its message, for a script")
    json_option(form)


def run_list(options: Options) -> ExitCode:
    """Prints the table of topics."""
    topics = all_topics()
    if options.types:
        return print_value(topics, False, lambda: "\n".join(f"{each.key} [{each.message.__name__}]" for each in topics))
    return print_value([head_of(each) for each in topics], options.json, lambda: listing(topics))


def topic_option(parser: Parser) -> None:
    """Adds the topic."""
    parser.add_argument("topic", metavar="TOPIC", help="a key of `gemelo topic list`")


def info_options(parser: Parser) -> None:
    """Adds topic and --json."""
    topic_option(parser)
    json_option(parser)


def run_info(options: Options) -> ExitCode:
    """Prints one topic; where a router listens, with the living nodes that write and read it."""
    known = known_topic(options.topic)
    if known is not None and not router_listens():
        return print_value(about(known), options.json, lambda: information(known))
    with connected(options.topic) as (session, topic):
        told = with_ends(topic, ends(session, topic))
    return print_value(told, options.json, lambda: dump(told))


def echo_options(parser: Parser) -> None:
    """Adds topic with field, count, --json and --csv."""
    parser.add_argument(
        "topic", metavar="TOPIC[.FIELD]", help="a key of `gemelo topic list`, and a field of its message"
    )
    count_options(parser, "messages")
    form_options(parser)


def run_echo(options: Options) -> ExitCode:
    """Prints the messages of a topic, or one of their fields."""
    key, _, path = options.topic.partition(".")
    form = form_of(options, yaml_document)
    known = known_topic(key)
    if known is not None:
        FieldPath(known.message, path)  # a mistake is told before anything is connected
    with connected(key) as (session, topic):
        return echo(session, topic, FieldPath(topic.message, path), form, options.count)


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


def topic_of(name: str) -> Topic[Any]:
    """The topic of that name in our own table; raises `CommandError` with the nearest name."""
    known = known_topic(name)
    if known is None:
        raise unknown("topic", name, [topic.key for topic in TOPICS])
    return known


def listing(topics: Sequence[Topic[Any]] = TOPICS) -> str:
    """The table of topics."""
    rows = [
        (topic.key, topic.message.__name__, rate_of(topic), topic.delivery.value, topic.writer, translated(topic.about))
        for topic in topics
    ]
    return table(columns("topic", "message", "rate [Hz]", "delivery", "writer", "about"), rows)


def rate_of(topic: Topic[Message]) -> str:
    """The rate [Hz] as text."""
    return "-" if topic.rate is None else f"{topic.rate:g}"


def information(topic: Topic[Message]) -> str:
    """One topic and the fields of its message as YAML."""
    return dump(about(topic))


def about(topic: Topic[Message]) -> dict[str, object]:
    """One topic and the fields of its message, by their names."""
    fields = topic.fields if isinstance(topic, LivingTopic) else fields_of(topic.message)
    return {**head_of(topic), "fields": fields}


def with_ends(topic: Topic[Message], living: Ends) -> dict[str, object]:
    """As `about`, with the living nodes that write and read the topic."""
    return {**about(topic), "written_by": living.written_by, "read_by": living.read_by}


def head_of(topic: Topic[Message]) -> dict[str, object]:
    """A row of the table of topics, by its names; the rate in [Hz]."""
    return {
        "topic": topic.key, "about": topic.about, "message": topic.message.__name__, "rate_hz": topic.rate,
        "delivery": topic.delivery.value, "recorded": topic.recorded, "writer": topic.writer,
    }  # fmt: skip


def echo(session: CommandSession, topic: Topic[Message], field: FieldPath, form: Form, count: int | None) -> ExitCode:
    """Prints messages, or their field, as they come, until Ctrl-C or `count` of them; raises `CommandError` where a
    message has no such element."""
    printed = 0

    def on_message(message: Message) -> None:
        nonlocal printed
        if count is not None and printed >= count:
            return
        printed += 1
        print(form(field.of(message)), flush=True)
        if printed == count:
            session.node.stop()

    return listen(session, topic, on_message)


def listen(
    session: CommandSession,
    topic: Topic[Any],
    on_message: Callable[[Message], None],
    step: Callable[[int], None] = lambda now: None,
) -> ExitCode:
    session.node.subscribe(topic, on_message)
    session.node.spin(step, rate=50.0)
    return ExitCode.OK


def publish(
    session: CommandSession, topic: Topic[Message], message: Message, rate: float | None, count: int | None
) -> ExitCode:
    """Publishes once, `count` times, or at `rate` [Hz] until Ctrl-C."""
    if topic.writer != "any":
        raise CommandError(because("cli.topic.one_writer", writer=topic.writer, topic=topic.key))
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
    print(sentence(because("cli.topic.published", count=sent, message=topic.message.__name__, topic=topic.key)))
    return ExitCode.OK


def stamped(message: Message, now: int) -> Message:
    """The message with the present time, if it has a stamp that is 0."""
    if getattr(message, "stamp", None) == 0:
        return msgspec.structs.replace(message, stamp=now)
    return message
