"""`gemelo topic hz`, `bw` and `delay`: how often messages come, how large they are, and how old."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from itertools import pairwise
from typing import Any

from schemas.message import Message, encode
from schemas.topics import Topic
from services.cli.errors import ExitCode, usage
from services.cli.living_topics import connected
from services.cli.parser import Options, Parser, positive_integer
from services.cli.session import Session
from services.cli.topic import listen, topic_option

REPORT_EVERY = 1.0  # [s]
Report = Callable[[], str | None]


def rate_options(parser: Parser) -> None:
    """Adds topic, window and count."""
    topic_option(parser)
    parser.add_argument("-w", "--window", type=positive_integer, default=10_000, metavar="N", help="messages averaged")
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N reports")


def run_hz(options: Options) -> ExitCode:
    """Prints the rate of a topic."""
    with connected(options.topic) as (session, topic):
        return hz(session, topic, options.window, options.count)


def run_bw(options: Options) -> ExitCode:
    """Prints the bandwidth of a topic."""
    with connected(options.topic) as (session, topic):
        return bandwidth(session, topic, options.window, options.count)


def run_delay(options: Options) -> ExitCode:
    """Prints how old the messages of a topic are when they come."""
    with connected(options.topic) as (session, topic):
        if "stamp" not in topic.message.__struct_fields__:
            raise usage(f"{topic.message.__name__} has no stamp, so that nobody knows how old it is")
        return delay(session, topic, options.window, options.count)


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


class Window:
    """Arrival times [s, monotonic] of the last `size` messages, each with one number."""

    def __init__(self, size: int) -> None:
        self.rows: deque[tuple[float, float]] = deque(maxlen=size)
        self.total = 0  # messages ever seen

    def add(self, time: float, number: float) -> None:
        """Takes a message that came at `time` [s, monotonic]."""
        self.rows.append((time, number))
        self.total += 1


def hz(session: Session, topic: Topic[Any], window: int, count: int | None) -> ExitCode:
    """Prints the rate of arrival once a second, until Ctrl-C or `count` reports."""
    arrivals = RateWindow(window)

    def on_message(message: Message) -> None:
        arrivals.add(session.node.monotonic())

    return _reported(session, topic, on_message, lambda: arrivals.total, arrivals.report, count)


def bandwidth(session: Session, topic: Topic[Any], window: int, count: int | None) -> ExitCode:
    """Prints the bytes of the messages' payloads once a second, in the form of `ros2 topic bw`."""
    seen = Window(window)

    def on_message(message: Message) -> None:
        seen.add(session.node.monotonic(), len(encode(message)))

    def report() -> str | None:
        if len(seen.rows) < 2:
            return None
        sizes = [size for _, size in seen.rows]
        span = seen.rows[-1][0] - seen.rows[0][0]
        rate = sum(sizes[1:]) / span if span > 0.0 else math.inf
        mean = sum(sizes) / len(sizes)
        return (
            f"{rate / 1000.0:.2f} kB/s from {len(sizes)} messages\n"
            f"\tmessage size mean: {mean:.0f} B min: {min(sizes):.0f} B max: {max(sizes):.0f} B"
        )

    return _reported(session, topic, on_message, lambda: seen.total, report, count)


def delay(session: Session, topic: Topic[Any], window: int, count: int | None) -> ExitCode:
    """Prints the time from the messages' stamps to their arrival once a second; both clocks must agree."""
    seen = Window(window)

    def on_message(message: Message) -> None:
        stamp = getattr(message, "stamp", 0)
        if stamp:
            seen.add(session.node.monotonic(), (session.node.now() - stamp) / 1e9)

    def report() -> str | None:
        ages = [1000.0 * age for _, age in seen.rows]
        if not ages:
            return None
        mean = sum(ages) / len(ages)
        deviation = math.sqrt(sum((age - mean) ** 2 for age in ages) / len(ages))
        return (
            f"average delay: {mean:.2f} ms\n\tmin: {min(ages):.2f} ms max: {max(ages):.2f} ms "
            f"std dev: {deviation:.2f} ms window: {len(ages)}"
        )

    return _reported(session, topic, on_message, lambda: seen.total, report, count)


def _reported(
    session: Session,
    topic: Topic[Any],
    on_message: Callable[[Message], None],
    total: Callable[[], int],
    report: Report,
    count: int | None,
) -> ExitCode:
    """Prints `report` once a second where `total` has grown, until Ctrl-C or `count` of them."""
    reports, heard, last = 0, 0, session.node.monotonic()

    def step(now: int) -> None:
        nonlocal reports, heard, last
        if session.node.monotonic() - last < REPORT_EVERY:
            return
        last = session.node.monotonic()
        text = report() if total() > heard else None
        print(text or f"no new messages on {topic.key}", flush=True)
        heard = total()
        reports += 1
        if reports == count:
            session.node.stop()

    return listen(session, topic, on_message, step)
