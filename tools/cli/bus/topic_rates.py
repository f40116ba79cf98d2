"""`gemelo topic hz`, `bw` and `delay`: how often messages come, how large they are, and how old."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import msgspec

from gemelo.schemas.message import Message, encode
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import Topic
from gemelo.tools.cli.bus.living_topics import connected
from gemelo.tools.cli.bus.topic import listen, topic_option
from gemelo.tools.cli.common.errors import ExitCode, usage
from gemelo.tools.cli.common.forms import Form, count_options, form_of, form_options
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.parser import Options, Parser, positive_integer

REPORT_EVERY = 1.0  # [s]


class MeasuredRate(msgspec.Struct, frozen=True, kw_only=True):
    """How often messages came, in the form of `ros2 topic hz` for a person."""

    rate: float  # [Hz]
    gap_min: float  # [s] between two
    gap_max: float  # [s]
    gap_deviation: float  # [s]
    window: int  # messages

    def __str__(self) -> str:
        gaps = {"least": self.gap_min, "most": self.gap_max, "deviation": self.gap_deviation}
        return sentence(because("cli.topic.rate", rate=self.rate, window=self.window, **gaps))


class Bandwidth(msgspec.Struct, frozen=True, kw_only=True):
    """How many bytes came, in the form of `ros2 topic bw` for a person."""

    bytes_per_second: float
    size_mean: float  # [B] of a message
    size_min: int  # [B]
    size_max: int  # [B]
    window: int  # messages

    def __str__(self) -> str:
        sizes = {"mean": self.size_mean, "least": self.size_min, "most": self.size_max}
        rate = self.bytes_per_second / 1000.0
        return sentence(because("cli.topic.bandwidth", rate=rate, window=self.window, **sizes))


class Delay(msgspec.Struct, frozen=True, kw_only=True):
    """How old messages were when they came."""

    delay_mean: float  # [s]
    delay_min: float  # [s]
    delay_max: float  # [s]
    delay_deviation: float  # [s]
    window: int  # messages

    def __str__(self) -> str:
        mean, least, most, deviation = (
            1000.0 * each for each in (self.delay_mean, self.delay_min, self.delay_max, self.delay_deviation)
        )
        times = {"mean": mean, "least": least, "most": most, "deviation": deviation}
        return sentence(because("cli.topic.delay", window=self.window, **times))


Report = Callable[[], MeasuredRate | Bandwidth | Delay | None]


def rate_options(parser: Parser) -> None:
    """Adds topic, window, count and form."""
    topic_option(parser)
    parser.add_argument("-w", "--window", type=positive_integer, default=10_000, metavar="N", help="messages averaged")
    count_options(parser, "reports")
    form_options(parser)


def run_hz(options: Options) -> ExitCode:
    """Prints the rate of a topic."""
    with connected(options.topic) as (session, topic):
        return hz(session, topic, options.window, options.count, form_of(options, str))


def run_bw(options: Options) -> ExitCode:
    """Prints the bandwidth of a topic."""
    with connected(options.topic) as (session, topic):
        return bandwidth(session, topic, options.window, options.count, form_of(options, str))


def run_delay(options: Options) -> ExitCode:
    """Prints how old the messages of a topic are when they come."""
    with connected(options.topic) as (session, topic):
        if "stamp" not in topic.message.__struct_fields__:
            raise usage(because("cli.topic.no_stamp", message=topic.message.__name__))
        return delay(session, topic, options.window, options.count, form_of(options, str))


class RateWindow:
    """Arrival times [s, monotonic] of the last `size` messages."""

    def __init__(self, size: int = 10_000) -> None:
        self._times: deque[float] = deque(maxlen=size)
        self.total = 0  # messages ever seen

    def add(self, time: float) -> None:
        """Takes the arrival of a message at `time` [s, monotonic]."""
        self._times.append(time)
        self.total += 1

    def report(self) -> MeasuredRate | None:
        """None after fewer than two messages."""
        if len(self._times) < 2:
            return None
        times = list(self._times)
        gaps = [after - before for before, after in pairwise(times)]
        mean = sum(gaps) / len(gaps)
        return MeasuredRate(
            rate=1.0 / mean if mean > 0.0 else math.inf,
            gap_min=min(gaps),
            gap_max=max(gaps),
            gap_deviation=deviation_of(gaps, mean),
            window=len(times),
        )


class ArrivalWindow:
    """Arrival times [s, monotonic] of the last `size` messages, each with one number."""

    def __init__(self, size: int) -> None:
        self.rows: deque[tuple[float, float]] = deque(maxlen=size)
        self.total = 0  # messages ever seen

    def add(self, time: float, number: float) -> None:
        """Takes a message that came at `time` [s, monotonic]."""
        self.rows.append((time, number))
        self.total += 1


def deviation_of(values: Sequence[float], mean: float) -> float:
    """The standard deviation of `values` from their mean, in their unit."""
    return math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))


def hz(session: CommandSession, topic: Topic[Any], window: int, count: int | None, form: Form = str) -> ExitCode:
    """Prints the rate of arrival once a second, until Ctrl-C or `count` reports."""
    arrivals = RateWindow(window)

    def on_message(message: Message) -> None:
        arrivals.add(session.node.monotonic())

    return _reported(session, topic, on_message, lambda: arrivals.total, arrivals.report, count, form)


def bandwidth(session: CommandSession, topic: Topic[Any], window: int, count: int | None, form: Form = str) -> ExitCode:
    """Prints the bytes of the messages' payloads once a second."""
    seen = ArrivalWindow(window)

    def on_message(message: Message) -> None:
        seen.add(session.node.monotonic(), len(encode(message)))

    def report() -> Bandwidth | None:
        if len(seen.rows) < 2:
            return None
        sizes = [round(size) for _, size in seen.rows]
        span = seen.rows[-1][0] - seen.rows[0][0]
        return Bandwidth(
            bytes_per_second=sum(sizes[1:]) / span if span > 0.0 else math.inf,
            size_mean=sum(sizes) / len(sizes),
            size_min=min(sizes),
            size_max=max(sizes),
            window=len(sizes),
        )

    return _reported(session, topic, on_message, lambda: seen.total, report, count, form)


def delay(session: CommandSession, topic: Topic[Any], window: int, count: int | None, form: Form = str) -> ExitCode:
    """Prints the time from the messages' stamps to their arrival once a second; both clocks must agree."""
    seen = ArrivalWindow(window)

    def on_message(message: Message) -> None:
        stamp = getattr(message, "stamp", 0)
        if stamp:
            seen.add(session.node.monotonic(), (session.node.now() - stamp) / 1e9)

    def report() -> Delay | None:
        ages = [age for _, age in seen.rows]
        if not ages:
            return None
        mean = sum(ages) / len(ages)
        return Delay(
            delay_mean=mean,
            delay_min=min(ages),
            delay_max=max(ages),
            delay_deviation=deviation_of(ages, mean),
            window=len(ages),
        )

    return _reported(session, topic, on_message, lambda: seen.total, report, count, form)


def _reported(
    session: CommandSession,
    topic: Topic[Any],
    on_message: Callable[[Message], None],
    total: Callable[[], int],
    report: Report,
    count: int | None,
    form: Form,
) -> ExitCode:
    """Prints `report` once a second where `total` has grown, until Ctrl-C or `count` of them.

    That nothing has come is a sentence for a person; a program waits for what has come.
    """
    reports, heard, last = 0, 0, session.node.monotonic()

    def step(now: int) -> None:
        nonlocal reports, heard, last
        if session.node.monotonic() - last < REPORT_EVERY:
            return
        last = session.node.monotonic()
        found = report() if total() > heard else None
        heard = total()
        if found is None and form is not str:
            return
        silence = because("cli.topic.silent", topic=topic.key)
        print(sentence(silence) if found is None else form(found), flush=True)
        reports += 1
        if reports == count:
            session.node.stop()

    return listen(session, topic, on_message, step)
