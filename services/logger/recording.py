"""One recording: an MCAP of messages and a CSV of commands that begin and end together.

Every write ends a chunk and hands it to the operating system, so that a process that is killed loses only
what it had not been given yet: the streaming reader finds the rest.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from contextlib import suppress
from itertools import groupby
from pathlib import Path
from typing import IO

import msgspec
from mcap.writer import CompressionType, Writer

from schemas.frames import RobotDescription
from schemas.message import Message
from schemas.topics import Topic
from services.logger.channels import MESSAGE_ENCODING, SCHEMA_ENCODING, channel_of, recorded_topics
from services.logger.command_log import CommandRow, Row, header
from services.logger.core import Entry
from services.logger.files import CSV, MCAP

CHUNK_SIZE = 32 * 1024  # [B] uncompressed

_encode = msgspec.json.Encoder().encode


class Recording:
    """The open files; every method raises OSError when the disk refuses, and the recording is then spent."""

    def __init__(self, folder: Path, stem: str, started: int, metadata: dict[str, str]) -> None:
        self.path = folder / (stem + MCAP)
        self.csv_path = folder / (stem + CSV)
        self.started = started  # [ns] UNIX time
        self._described = ""
        self._sequences: dict[int, int] = {}
        self._tables: dict[tuple[str, ...], IO[str]] = {}
        self._file: IO[bytes] = self.path.open("xb")
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self._writer.start(profile="gemelo")
        self._writer.add_metadata("gemelo", metadata)
        self._channels: dict[str, int] = {}
        for topic in recorded_topics():
            self._register(topic)

    @property
    def size(self) -> int:
        """[B] of the MCAP on disk."""
        return self._file.tell()

    def write(self, entries: Iterable[Entry]) -> None:
        """Add messages, and make them survive this process."""
        for entry in entries:
            channel = self._channels.get(entry.topic.key) or self._register(entry.topic)
            sequence = self._sequences[channel] = self._sequences.get(channel, -1) + 1
            self._writer.add_message(channel, entry.arrival, _encode(entry.message), entry.stamp, sequence)
        self._writer.flush()

    def describe(self, description: RobotDescription) -> None:
        """Keep the robot's own files beside the data, once."""
        if self._described == description.urdf + description.robot_toml:
            return
        self._described = description.urdf + description.robot_toml
        files = {"urdf": description.urdf, "srdf": description.srdf, "robot_toml": description.robot_toml}
        self._writer.add_metadata("robot", {"robot": description.robot, **files})
        self._writer.flush()

    def write_lines(self, lines: Iterable[CommandRow]) -> None:
        """Add commands, each to the table of its joints."""
        for joints, group in groupby(lines, key=lambda line: line.joints):
            table = self._tables.get(joints) or self._begin_table(joints)
            table.write(_csv(line.cells for line in group))
            table.flush()

    def close(self) -> None:
        """End the files properly, with the index that lets readers jump."""
        try:
            self._writer.finish()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Let go of files that the disk no longer takes."""
        files: tuple[IO[bytes] | IO[str], ...] = (self._file, *self._tables.values())
        for file in files:
            with suppress(OSError):
                file.close()

    def _begin_table(self, joints: tuple[str, ...]) -> IO[str]:
        """A table begins with its first command, when the joints are known; other joints get one of their own."""
        number = f"_{len(self._tables) + 1}" if self._tables else ""
        path = self.csv_path.with_name(self.csv_path.stem + number + CSV)
        table = self._tables[joints] = path.open("x", encoding="utf-8", newline="")
        table.write(_csv([header(joints)]))
        return table

    def _register(self, topic: Topic[Message]) -> int:
        """The channel of a topic; those that are not in the table get one with their first message."""
        channel = channel_of(topic)
        schema = self._writer.register_schema(channel.schema_name, SCHEMA_ENCODING, channel.schema)
        number: int = self._writer.register_channel(channel.key, MESSAGE_ENCODING, schema, channel.metadata)
        self._channels[channel.key] = number
        return number


def _csv(rows: Iterable[Row]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
