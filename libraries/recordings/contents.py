"""The contents of a recording, without reading its messages where it has its index."""

from __future__ import annotations

from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec
from mcap.reader import make_reader

from gemelo.libraries.recordings.mcap_file import CLOCKS
from gemelo.libraries.recordings.reader import UNREADABLE, Damage, RecordingReader
from gemelo.schemas.reasons import Reason, because


class TopicContents(msgspec.Struct, frozen=True, kw_only=True):
    """One topic of a recording."""

    topic: str
    message: str
    count: int
    rate: float  # [Hz] on average over the whole recording


class WriterClock(msgspec.Struct, frozen=True, kw_only=True):
    """The clock by which a node stamped what it wrote."""

    host: str
    offset: float | None = None  # [s] what it showed more than the recorder's; None: not measured
    bound: float = 0.0  # [s] by how much at most that is wrong


class Contents(msgspec.Struct, frozen=True, kw_only=True):
    """A recording as a whole."""

    file: str
    size: int  # [B]
    start: int  # [ns] UNIX arrival of the first message; 0: there is none
    duration: float  # [s] from the first message to the last
    messages: int  # without those that are derived for Foxglove
    topics: tuple[TopicContents, ...]
    versions: dict[str, str]
    clocks: dict[str, WriterClock] = {}  # by the node that wrote
    damage: str = ""  # why it ends early; empty: it is whole
    damage_why: Reason | None = None  # `damage` as data


@dataclass(frozen=True)
class _Counted:
    start: int
    end: int
    counts: dict[int, int]  # by channel


def contents_of(path: Path) -> Contents:
    """Reads the index, or the whole file where it has none; raises `BadRecording`."""
    reader = RecordingReader(path)
    counted = _from_index(reader) or _from_messages(reader)
    duration = (counted.end - counted.start) / 1e9
    topics = [
        TopicContents(
            topic=channel.topic,
            message=reader.schemas[channel.schema_id].name if channel.schema_id in reader.schemas else "",
            count=counted.counts[number],
            rate=counted.counts[number] / duration if duration > 0.0 else 0.0,
        )
        for number, channel in reader.channels.items()
        if "derived" not in channel.metadata and counted.counts.get(number)
    ]
    why = _why(reader.damage)
    return Contents(
        file=str(path), size=path.stat().st_size, start=counted.start, duration=duration,
        messages=sum(each.count for each in topics), topics=tuple(sorted(topics, key=lambda each: each.topic)),
        versions=reader.metadata.get("gemelo", {}), clocks=_clocks(reader), damage=str(why or ""), damage_why=why,
    )  # fmt: skip


def _clocks(reader: RecordingReader) -> dict[str, WriterClock]:
    found = {}
    for node, text in reader.metadata.get(CLOCKS, {}).items():
        with suppress(msgspec.DecodeError):  # of a file that somebody else has written
            found[node] = msgspec.json.decode(text, type=WriterClock)
    return found


def _why(damage: Damage) -> Reason | None:
    """None where the file is whole."""
    return None if damage.problem is None else because("recording.damaged", damage.problem)


def _from_index(reader: RecordingReader) -> _Counted | None:
    """None where the file was cut off before its index."""
    try:
        with reader.path.open("rb") as file:
            indexed = make_reader(file)
            summary = indexed.get_summary()
            if summary is None or summary.statistics is None:
                return None
            reader.channels, reader.schemas = dict(summary.channels), dict(summary.schemas)
            reader.metadata = {each.name: dict(each.metadata) for each in indexed.iter_metadata()}
    except UNREADABLE:
        return None
    found = summary.statistics
    return _Counted(found.message_start_time, found.message_end_time, dict(found.channel_message_counts))


def _from_messages(reader: RecordingReader) -> _Counted:
    counts: Counter[int] = Counter()
    start = end = 0
    for row in reader.rows():
        counts[row.channel.id] += 1
        start = min(start or row.message.log_time, row.message.log_time)
        end = max(end, row.message.log_time)
    return _Counted(start, end, dict(counts))
