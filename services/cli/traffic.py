"""`gemelo topic echo | hz | pub` and `gemelo request call`: what passes on the bus. The wire says its type."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import msgspec

from schemas.message import Message
from schemas.topics import Request, Topic
from services.cli.exits import CommandError, ExitCode
from services.cli.rate import RateWindow
from services.cli.yaml import dump

if TYPE_CHECKING:
    from services.cli.session import Session

CALL_TIMEOUT = 5.0  # [s]
HZ_EVERY = 1.0  # [s] between two reports


def call(session: Session, request: Request[Message, Message], message: Message) -> ExitCode:
    """Asks, and prints the answer as YAML."""
    print(dump(session.node.call(request, message, timeout=CALL_TIMEOUT)), end="")
    return ExitCode.OK


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
