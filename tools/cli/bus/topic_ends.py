"""The living nodes that write a topic and those that read it, with their rates and losses."""

from __future__ import annotations

from typing import Any

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.system import NodeInfo
from gemelo.schemas.topics import Topic
from gemelo.tools.cli.bus.node import living, told_information_of
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.watch.top import FIRST, Figures, figures_by_node


class Writer(msgspec.Struct, frozen=True, kw_only=True):
    """A node that writes the topic, and how often it was heard here."""

    process: str
    rate_hz: float


class TopicReader(msgspec.Struct, frozen=True, kw_only=True):
    """A node that reads the topic, with its own counters; None: it has not told them."""

    process: str
    rate_hz: float | None = None
    received: int | None = None  # since it began
    lost: int | None = None  # on the way, or overrun in its inbox
    bad: int | None = None  # not decodable


class Ends(msgspec.Struct, frozen=True, kw_only=True):
    """Both by the names of the nodes."""

    written_by: dict[str, Writer]
    read_by: dict[str, TopicReader]


def ends(session: CommandSession, topic: Topic[Any]) -> Ends:
    """Listens to the topic and to the counters of all nodes for `FIRST` [s]; one that does not answer is left out."""
    node = session.node
    heard: dict[str, list[float]] = {}  # [s] monotonic, by writer
    figures = figures_by_node(session)

    def on_message(message: Message, writer: str) -> None:
        heard.setdefault(writer, []).append(node.monotonic())

    subscription = node.subscribe_signed(topic, on_message)
    node.wait(FIRST)
    subscription.close()
    told = Ends(written_by={}, read_by={})
    for name in living(session):
        info = told_information_of(session, name)
        if info is None:
            continue
        if topic.key in info.publishes:
            told.written_by[name] = Writer(process=_process(info), rate_hz=_rate(heard.get(name, [])))
        if topic.key in info.subscribes:
            told.read_by[name] = _reader(info, topic.key, figures.get(name))
    return told


def _reader(info: NodeInfo, key: str, figures: Figures | None) -> TopicReader:
    counters = [each for each in figures.now.topics if each.key == key] if figures is not None else []
    if figures is None or not counters:
        return TopicReader(process=_process(info))
    return TopicReader(
        process=_process(info),
        rate_hz=round(figures.received()[key], 1),
        received=sum(each.received for each in counters),
        lost=sum(each.dropped for each in counters),
        bad=sum(each.bad for each in counters),
    )


def _process(info: NodeInfo) -> str:
    return f"{info.pid} on {info.host}"


def _rate(times: list[float]) -> float:
    """[1/s] from the first message to the last one; 0 where fewer than two were heard."""
    return round((len(times) - 1) / (times[-1] - times[0]), 1) if len(times) > 1 else 0.0
