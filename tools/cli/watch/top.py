"""`gemelo top`: every node with its loop, CPU, memory and losses, and the topics that come too seldom."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import msgspec

from gemelo.schemas.reasons import because
from gemelo.schemas.system import NodeInfo, NodeStatistics
from gemelo.schemas.topics import STATISTICS, TOPICS
from gemelo.tools.cli.bus.node import is_command, told_information_of
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.forms import Form, count_options, csv_rows, form_options, json_line
from gemelo.tools.cli.common.language import columns, sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser

EVERY = 1.0  # [s] every node tells its figures once a second
FIRST = 2.5  # [s] until two of every node have come
SAMPLING = 1.0  # messages by which two counts of a steady stream over the same time may differ
LATE_SHARE = 0.9  # of the promised rate: chosen, less is named
HEADINGS = ("node", "CPU [%]", "memory [MB]", "loop [Hz]", "worst lateness [ms]", "received [1/s]", "lost", "bad")


class NodeFigures(msgspec.Struct, frozen=True, kw_only=True):
    """A row of the table."""

    node: str
    cpu: float  # of a core
    memory: int | None  # [bytes] resident; None for a process of another machine
    loop_rate: float  # [Hz]
    loop_late_max: float  # [s]
    received: float  # [1/s] messages
    lost: int  # since the node's start
    bad: int


class SlowTopic(msgspec.Struct, frozen=True, kw_only=True):
    """A topic of which a node hears less than the table promises."""

    node: str
    topic: str
    heard: float  # [Hz]
    promised: float  # [Hz]
    writer: str

    def __str__(self) -> str:
        rates = {"rate": self.heard, "promised": self.promised}
        return sentence(because("cli.top.slow", node=self.node, topic=self.topic, writer=self.writer, **rates))


class TopReport(msgspec.Struct, frozen=True, kw_only=True):
    """What is said once a second."""

    nodes: tuple[NodeFigures, ...]
    slow_topics: tuple[SlowTopic, ...]

    def __str__(self) -> str:
        return "\n".join(
            [table(columns(*HEADINGS), [_cells(each) for each in self.nodes]), *map(str, self.slow_topics)]
        )


class Figures(NamedTuple):
    """The last two reports of one process of a node, a second apart."""

    before: NodeStatistics
    now: NodeStatistics

    @property
    def seconds(self) -> float:
        """[s] between the two."""
        return max(1e-3, (self.now.stamp - self.before.stamp) / 1e9)

    def received(self) -> dict[str, float]:
        """[1/s] by key."""
        before = {each.key: each.received for each in self.before.topics}
        return {each.key: (each.received - before.get(each.key, 0)) / self.seconds for each in self.now.topics}


def figures_by_node(session: CommandSession) -> dict[str, Figures]:
    """Fills, by address, with those that have spoken twice; one that was started again begins anew."""
    newest: dict[str, NodeStatistics] = {}
    figures: dict[str, Figures] = {}

    def on_statistics(message: NodeStatistics, address: str) -> None:
        before = newest.get(address)
        newest[address] = message
        if before is not None and before.started == message.started:
            figures[address] = Figures(before, message)
        else:
            figures.pop(address, None)

    session.node.subscribe_signed(STATISTICS, on_statistics)
    return figures


def add_options(parser: Parser) -> None:
    """Adds count and form."""
    count_options(parser, "reports")
    form_options(parser)


def run(options: Options) -> ExitCode:
    """Prints the tables once a second, until Ctrl-C."""
    with connect() as session:
        return watch(session, options.count, form_of_reports(options))


def form_of_reports(options: Options) -> Form:
    """As text or JSON all of a report; as CSV its nodes."""
    if not options.csv:
        return json_line if options.json else str
    rows = csv_rows()
    return lambda report: rows(report.nodes)


def watch(session: CommandSession, count: int | None, form: Form = str) -> ExitCode:
    """Prints `count` reports."""
    infos: dict[str, NodeInfo | None] = {}
    asked: dict[str, int] = {}  # [ns] UNIX start of the process whose information it is
    node, printed, last = session.node, 0, session.node.monotonic() + FIRST - EVERY
    heard = figures_by_node(session)

    def step(now: int) -> None:
        nonlocal printed, last
        if node.monotonic() - last < EVERY:
            return
        last = node.monotonic()
        alive = {name for name in node.alive() if not is_command(name)}
        figures = {name: each for name, each in sorted(heard.items()) if name in alive}
        for name, each in figures.items():
            if asked.get(name) != each.now.started:
                infos[name], asked[name] = told_information_of(session, name), each.now.started
        print(form(report(figures, infos)), flush=True)
        printed += 1
        if printed == count:
            node.stop()

    node.spin(step, rate=10.0)
    return ExitCode.OK


def report(figures: Mapping[str, Figures], infos: Mapping[str, NodeInfo | None]) -> TopReport:
    """A row for each node, and the topics that come too seldom."""
    nodes = tuple(_row(name, each, infos.get(name)) for name, each in figures.items())
    return TopReport(nodes=nodes, slow_topics=tuple(slow_topics(figures)))


def _row(name: str, each: Figures, info: NodeInfo | None) -> NodeFigures:
    topics = each.now.topics
    return NodeFigures(
        node=name,
        cpu=each.now.cpu,
        memory=memory(info),
        loop_rate=each.now.loop_rate,
        loop_late_max=each.now.loop_late_max,
        received=sum(each.received().values()),
        lost=sum(topic.dropped for topic in topics),
        bad=sum(topic.bad for topic in topics),
    )


def _cells(each: NodeFigures) -> Sequence[str]:
    return (
        each.node,
        f"{100.0 * each.cpu:.1f}",
        "-" if each.memory is None else f"{each.memory / 1e6:.0f}",
        f"{each.loop_rate:.0f}",
        f"{1000.0 * each.loop_late_max:.1f}",
        f"{each.received:.0f}",
        str(each.lost),
        str(each.bad),
    )


def memory(info: NodeInfo | None) -> int | None:
    """[bytes] resident of a process on this machine; None for others, and where `info` is not known."""
    import psutil  # 20 ms

    if info is None or info.host != socket.gethostname():
        return None
    try:
        return int(psutil.Process(info.pid).memory_info().rss)
    except psutil.Error:
        return None


def slow_topics(figures: Mapping[str, Figures]) -> Iterator[SlowTopic]:
    """Topics of which a node hears less than the table promises; silent ones may have no writer, and are left out.

    Of a steady stream one message may lie on this or on that side of each end of a second: one less says nothing.
    """
    for topic in TOPICS:
        for name, each in figures.items():
            heard = each.received().get(topic.key, 0.0)
            promised = topic.rest_rate or topic.rate  # at rest or in motion: at least so many
            if promised is not None and 0.0 < heard < LATE_SHARE * promised - SAMPLING / each.seconds:
                yield SlowTopic(node=name, topic=topic.key, heard=heard, promised=promised, writer=topic.writer)
