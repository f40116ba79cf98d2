"""`gemelo top`: every node with its loop, CPU, memory and losses, and the topics that come too seldom."""

from __future__ import annotations

import socket
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from schemas.system import NodeInfo, NodeStatistics
from schemas.topics import STATISTICS, TOPICS
from services.cli.errors import ExitCode
from services.cli.node import information_of
from services.cli.parser import Options, Parser, positive_integer
from services.cli.session import Session, connect
from services.cli.text_table import table

EVERY = 1.0  # [s] every node tells its figures once a second
FIRST = 2.5  # [s] until two of every node have come
LATE_SHARE = 0.9  # of the promised rate: chosen, less is named
HEADINGS = ("node", "CPU [%]", "memory [MB]", "loop [Hz]", "worst lateness [ms]", "received [1/s]", "lost", "bad")


class Figures(NamedTuple):
    """The last two reports of a node, a second apart."""

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


def add_options(parser: Parser) -> None:
    """Adds the number of reports."""
    parser.add_argument("-n", "--count", type=positive_integer, metavar="N", help="end after N reports")


def run(options: Options) -> ExitCode:
    """Prints the tables once a second, until Ctrl-C."""
    with connect() as session:
        return watch(session, options.count)


def watch(session: Session, count: int | None) -> ExitCode:
    """Prints `count` reports."""
    reports: dict[str, list[NodeStatistics]] = {}
    infos: dict[str, NodeInfo] = {}
    node, printed, last = session.node, 0, session.node.monotonic() + FIRST - EVERY

    def on_statistics(message: NodeStatistics) -> None:
        kept = reports.setdefault(message.node, [])
        kept[:] = [*kept[-1:], message]

    def step(now: int) -> None:
        nonlocal printed, last
        if node.monotonic() - last < EVERY:
            return
        last = node.monotonic()
        alive = {name for name in node.alive() if not name.startswith("cli-")}
        figures = {name: Figures(*kept) for name, kept in sorted(reports.items()) if len(kept) == 2 and name in alive}
        for name in figures:
            if name not in infos:
                infos[name] = information_of(session, name)
        print(report(figures, infos), flush=True)
        printed += 1
        if printed == count:
            node.stop()

    node.subscribe(STATISTICS, on_statistics)
    node.spin(step, rate=10.0)
    return ExitCode.OK


def report(figures: Mapping[str, Figures], infos: Mapping[str, NodeInfo]) -> str:
    """The table of nodes, and a line for each topic that comes too seldom."""
    rows = [_row(name, each, infos.get(name)) for name, each in figures.items()]
    return "\n".join([table(HEADINGS, rows), *slow_topics(figures)])


def _row(name: str, each: Figures, info: NodeInfo | None) -> Sequence[str]:
    topics = each.now.topics
    return (
        name,
        f"{100.0 * each.now.cpu:.1f}",
        memory(info),
        f"{each.now.loop_rate:.0f}",
        f"{1000.0 * each.now.loop_late_max:.1f}",
        f"{sum(each.received().values()):.0f}",
        str(sum(topic.dropped for topic in topics)),
        str(sum(topic.bad for topic in topics)),
    )


def memory(info: NodeInfo | None) -> str:
    """[MB] of a process on this machine; "-" for others."""
    import psutil  # 20 ms

    if info is None or info.host != socket.gethostname():
        return "-"
    try:
        return f"{psutil.Process(info.pid).memory_info().rss / 1e6:.0f}"
    except psutil.Error:
        return "-"


def slow_topics(figures: Mapping[str, Figures]) -> Iterator[str]:
    """Topics of which a node hears less than the table promises; silent ones may have no writer, and are left out."""
    for topic in TOPICS:
        for name, each in figures.items():
            heard = each.received().get(topic.key, 0.0)
            if topic.rate is not None and 0.0 < heard < LATE_SHARE * topic.rate:
                yield f"{name} hears {topic.key} {heard:.1f} times a second; {topic.writer} promises {topic.rate:g}"
