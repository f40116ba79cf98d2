"""An MCAP that is being written: messages of our topics, and beside them what Foxglove shows of them.

Every write ends a chunk and hands it to the operating system, so that a process that is killed loses only
what it had not been given yet: the streaming reader finds the rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

import msgspec
from mcap.writer import CompressionType, Writer

from gemelo.libraries.recordings import foxglove
from gemelo.libraries.recordings.channels import MESSAGE_ENCODING, SCHEMA_ENCODING, Channel, Entry, channel_of
from gemelo.libraries.recordings.foreign import PROFILE
from gemelo.libraries.runtime.process.own_files import created
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.system import NodeRecord
from gemelo.schemas.topics import Topic

# [B] uncompressed; more than the batch of one write (measured: 110 kB), so that each becomes one chunk: the writer
# keeps 2 kB of index for every chunk until the file ends.
CHUNK_SIZE = 1024 * 1024
ROBOT, DEPLOYMENT = "robot", "deployment"  # the names of our metadata records, beside METADATA
CLOCKS = "clocks"  # of another one: by node, whose stamps it writes and how far its clock is from the recorder's

_encode = msgspec.json.Encoder(enc_hook=repr).encode  # repr: msgpack's own extensions in a user's messages


class McapFile:
    """The open file; every method raises OSError when the disk refuses, and the file is then spent."""

    def __init__(
        self,
        path: Path,
        metadata: dict[str, dict[str, str]],
        topics: Iterable[Topic[Any]] = (),
        compression: CompressionType = CompressionType.ZSTD,
    ) -> None:
        """`metadata` by the name of its record; `topics` have a channel from the beginning, others with their first."""
        self.path = path
        self.unreadable = 0  # messages that have no JSON
        self._described = ""
        self._channels: dict[tuple[str, type], int] = {}
        self._sequences: dict[int, int] = {}
        self._clocks: dict[str, str] = {}
        self._twin = foxglove.FoxgloveTwin()
        self._file: IO[bytes] = created(path)
        self._writer = Writer(self._file, chunk_size=CHUNK_SIZE, compression=compression)
        try:
            self._derived = self._begin(metadata, topics)
        except OSError:
            self.abandon()
            with suppress(OSError):
                path.unlink()
            raise

    def _begin(self, metadata: dict[str, dict[str, str]], topics: Iterable[Topic[Any]]) -> dict[str, int]:
        """The channels of what Foxglove shows, by key."""
        self._writer.start(profile=PROFILE)
        for name, values in metadata.items():
            self._writer.add_metadata(name, values)
        for topic in topics:
            self._channel(topic)
        return {channel.key: self._register(channel) for channel in foxglove.channels()}

    @property
    def size(self) -> int:
        """[B] on disk."""
        return self._file.tell()

    def write(self, entries: Iterable[Entry]) -> None:
        """Adds messages, and makes them survive this process."""
        for entry in entries:
            try:
                data = _encode(entry.message)
            except (TypeError, ValueError, RecursionError, OverflowError):
                self.unreadable += 1
                continue
            self._add(self._channel(entry.topic), entry, data)
            if isinstance(entry.message, RobotDescription):
                self.describe(entry.message)
            elif isinstance(entry.message, NodeRecord):
                self._clocks[entry.message.node] = clock_text(entry.message)
            for key, message in self._twin.derived(entry):
                self._add(self._derived[key], entry, _encode(message))
        self._writer.flush()

    def describe(self, description: RobotDescription) -> None:
        """Keeps the robot's own files beside the data, once."""
        if self._described == description.urdf + description.robot_toml:
            return
        self._described = description.urdf + description.robot_toml
        files = {"urdf": description.urdf, "srdf": description.srdf, "robot_toml": description.robot_toml}
        self._writer.add_metadata(ROBOT, {"robot": description.robot, **files})
        self._writer.flush()

    def close(self) -> None:
        """Ends the file properly, with the clocks as they were last, and the index that lets readers jump."""
        try:
            if self._clocks:
                self._writer.add_metadata(CLOCKS, self._clocks)
            self._writer.finish()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Lets go of a file that the disk no longer takes."""
        with suppress(OSError):
            self._file.close()

    def _add(self, channel: int, entry: Entry, data: bytes) -> None:
        sequence = self._sequences[channel] = self._sequences.get(channel, -1) + 1
        self._writer.add_message(channel, entry.arrival, data, entry.stamp, sequence)

    def _channel(self, topic: Topic[Any]) -> int:
        known = (topic.key, topic.message)
        if known not in self._channels:
            self._channels[known] = self._register(channel_of(topic))
        return self._channels[known]

    def _register(self, channel: Channel) -> int:
        schema = self._writer.register_schema(channel.schema_name, SCHEMA_ENCODING, channel.schema)
        return self._writer.register_channel(channel.key, MESSAGE_ENCODING, schema, channel.metadata)  # type: ignore[no-any-return]


def clock_text(record: NodeRecord) -> str:
    """As JSON: the host whose clock stamped what this node wrote, and that clock against the recorder's, in [s]."""
    said = {"host": record.info.host, "offset": record.clock_offset, "bound": record.clock_bound}
    return msgspec.json.encode(said).decode()
