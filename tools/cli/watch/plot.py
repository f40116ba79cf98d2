"""`gemelo plot`: fields of messages as curves over time, in the terminal."""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Callable, Iterator
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import TOPICS, Topic
from gemelo.tools.cli.bus.field_path import FieldPath, leaves
from gemelo.tools.cli.bus.living_topics import connected, known_topic, topic_on
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.common.units import positive_seconds
from gemelo.tools.cli.parser import Choices, Options, Parser, positive_integer
from gemelo.tools.cli.watch.chart import COLOURS, ChartCurve, chart

if TYPE_CHECKING:
    from gemelo import Robot

WINDOW = 10.0  # [s]
RATE = 5.0  # [Hz] at which it is drawn
LARGEST = 20_000  # points of a curve that are kept
PLAIN_SIZE = (100, 12)  # columns and rows of a panel where there is no terminal
LEAST_ROWS = 4
AXIS_ROWS = 2  # below a panel


def add_options(parser: Parser) -> None:
    """Adds the fields, --window, --once and -n."""
    parser.add_argument(
        "fields", nargs="+", metavar="TOPIC.FIELD",
        help="as joint_states.position[0]; a list or a message means every number in it",
    )  # fmt: skip
    parser.add_argument(
        "-w", "--window", type=positive_seconds, default=WINDOW, metavar="TIME", help=f"on the axis; {WINDOW:g}s"
    )
    end = parser.add_mutually_exclusive_group()
    end.add_argument("--once", action="store_true", help="end when the window is full")
    end.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N messages")


def run(options: Options) -> ExitCode:
    """Draws until Ctrl-C; where there is no terminal, once at the end."""
    wanted = [_split(field) for field in options.fields]
    for key, path in wanted:
        known = known_topic(key)
        if known is not None:
            FieldPath(known.message, path)  # a mistake is told before anything is connected
    with connected(wanted[0][0]) as (session, topic):
        topics = {wanted[0][0]: topic} | {key: topic_on(session, key) for key, _ in wanted[1:]}
        fields = [Field(topics[key], path) for key, path in wanted]
        return plot(session, fields, options.window, options.once, options.count)


def choices(robot: Robot | None) -> Choices:
    """The fields of every topic of the table."""
    return {"": [f"{topic.key}.{name}" for topic in TOPICS for name in topic.message.__struct_fields__]}


def _split(field: str) -> tuple[str, str]:
    key, _, path = field.partition(".")
    if not path:
        raise usage(because("cli.plot.no_field", field=field, topic=key))
    return key, path


class Field:
    """Part of a topic's messages."""

    def __init__(self, topic: Topic[Any], path: str) -> None:
        """Raises `CommandError` for a path that the message does not have."""
        self.topic, self._path = topic, path
        self._field = FieldPath(topic.message, path)
        self.unit = self._field.unit

    def numbers(self, message: Message) -> Iterator[tuple[str, float]]:
        """Each number of this part of a message, in its unit, with its name; raises `CommandError` without one."""
        found = False
        for path, value in leaves(self._field.of(message)):
            if isinstance(value, bool | int | float):
                found = True
                joint = "." if path and not path.startswith("[") else ""
                yield f"{self.topic.key}.{self._path}{joint}{path}", float(value)
        if not found:
            raise CommandError(because("cli.plot.no_number", field=f"{self.topic.key}.{self._path}"))


class CurvePoints(NamedTuple):
    """Where a curve's points are kept."""

    unit: str
    points: deque[tuple[float, float]]  # [s], value


class Plot:
    """The curves of the last `window` seconds."""

    def __init__(self, window: float) -> None:
        self._window = window
        self._curves: dict[str, CurvePoints] = {}
        self.began: float | None = None  # [s] when the first point came

    def add(self, name: str, unit: str, time: float, value: float) -> None:
        """Takes a number that came at `time` [s]; raises `CommandError` for one curve too many."""
        if name not in self._curves and len(self._curves) == len(COLOURS):
            raise CommandError(because("cli.plot.many", field=name, limit=len(COLOURS)))
        points = self._curves.setdefault(name, CurvePoints(unit, deque(maxlen=LARGEST))).points
        points.append((time, value))
        while points[0][0] < time - self._window:
            points.popleft()
        self.began = time if self.began is None else self.began

    def text(self, now: float, columns: int, rows: int | None, is_coloured: bool) -> str:
        """All panels: with colours one for each unit, else one for each curve. `rows` are those of the terminal, which
        they share; None gives each panel its own."""
        if self.began is None:
            return "nothing has come yet"
        panels = list(self._panels(is_coloured))
        spare = PLAIN_SIZE[1] * len(panels) if rows is None else rows - len(self._curves)
        each = max(spare // len(panels) - (0 if rows is None else AXIS_ROWS), LEAST_ROWS)
        return "\n".join(
            chart(curves, now - self._window, now, columns, each, unit, is_coloured) for unit, curves in panels
        )

    def _panels(self, is_coloured: bool) -> Iterator[tuple[str, list[ChartCurve]]]:
        by_unit = sorted(self._curves.items(), key=lambda item: item[1].unit)
        for unit, group in groupby(by_unit, key=lambda item: item[1].unit):
            curves = [ChartCurve(name, sample.points) for name, sample in group]
            yield from [(unit, curves)] if is_coloured else [(unit, [curve]) for curve in curves]


def plot(
    session: CommandSession, fields: list[Field], window: float, is_once: bool = False, count: int | None = None,
    block: LiveBlock | None = None,
) -> ExitCode:  # fmt: skip
    """Draws until Ctrl-C, until the window [s] is full or until `count` messages have come; the last picture stays."""
    node, curves, block = session.node, Plot(window), block or LiveBlock()
    heard, drawn, faults = 0, 0.0, list[CommandError]()

    def handler(parts: list[Field]) -> Callable[[Message], None]:
        def on_message(message: Message) -> None:
            nonlocal heard
            now = node.monotonic()
            if heard == count:
                return
            try:
                for part in parts:
                    for name, value in part.numbers(message):
                        curves.add(name, part.unit, now, value)
            except CommandError as error:
                faults.append(error)
                node.stop()
            heard += 1
            if heard == count:
                node.stop()

        return on_message

    def step(now: int) -> None:
        nonlocal drawn
        time = node.monotonic()
        if is_once and curves.began is not None and time - curves.began >= window:
            node.stop()
        if block.is_live and time - drawn >= 1.0 / RATE:
            drawn = time
            block.draw(_picture(curves, time, is_live=True), is_coloured=True)

    for key in dict.fromkeys(field.topic.key for field in fields):
        parts = [field for field in fields if field.topic.key == key]
        node.subscribe(parts[0].topic, handler(parts))
    node.spin(step, rate=4.0 * RATE)
    if faults:
        raise faults[0]
    block.say(_picture(curves, node.monotonic(), block.is_live), is_coloured=True)
    return ExitCode.OK


def _picture(curves: Plot, now: float, is_live: bool) -> str:
    if not is_live:
        return curves.text(now, PLAIN_SIZE[0], None, False)
    columns, rows = shutil.get_terminal_size()
    return curves.text(now, columns - 1, rows - 1, True)
