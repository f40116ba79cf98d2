"""The recordings that are kept with the code, and copies of them with something changed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.records import Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from gemelo.libraries.recordings.reader import RecordingReader
from tests.replay.recorded_bus import planner  # noqa: F401  # a fixture

RECORDINGS = Path(__file__).parent / "recordings"

Change = Callable[[Any], Any]  # of a record of the file: another one, or None to leave it out


def copied(source: Path, target: Path, change: Change) -> Path:
    """The recording with each record as `change` returns it."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    with target.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="gemelo")
        for record in map(change, RecordingReader(source).records()):
            match record:
                case Schema():
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                case Channel():
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], dict(record.metadata)
                    )
                case Message():
                    writer.add_message(
                        channels[record.channel_id], record.log_time, record.data, record.publish_time, record.sequence
                    )
                case Metadata():
                    writer.add_metadata(record.name, dict(record.metadata))
        writer.finish()
    return target


class Messages:
    """A change of single messages of one topic: `alter(content, number)` changes it, or returns False to drop it."""

    def __init__(self, topic: str, alter: Callable[[Any, int], Any]) -> None:
        self._topic, self._alter = topic, alter
        self._channels: set[int] = set()
        self._number = -1

    def __call__(self, record: Any) -> Any:
        if isinstance(record, Channel) and record.topic == self._topic:
            self._channels.add(record.id)
        if isinstance(record, Message) and record.channel_id in self._channels:
            self._number += 1
            content = json.loads(record.data)
            if self._alter(content, self._number) is False:
                return None
            record.data = json.dumps(content).encode()
        return record


@pytest.fixture
def changed(tmp_path: Path) -> Callable[[str, Change], Path]:
    """changed(service, change): a copy of the service's recording."""
    return lambda service, change: copied(RECORDINGS / f"{service}.mcap", tmp_path / f"{service}.mcap", change)
