"""A recording that is read from its beginning to its end, or to where it was cut off.

Only complete chunks are read, each checked by its CRC. So a file that a power failure has cut off reads like any
other, and says where it ends.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from os import SEEK_END
from pathlib import Path
from typing import IO, Any, TypeVar

import msgspec
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, DataEnd, Header, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from gemelo.libraries.recordings.foreign import METADATA, PROFILE, kind_of, reason_of
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, Remedy, because, remedy

S = TypeVar("S", bound=msgspec.Struct)

MAGIC = b"\x89MCAP0\r\n"
UNREADABLE = (McapError, struct.error, ValueError, EOFError, OSError, KeyError, IndexError, MemoryError)
LOOKED_AT = 1000  # messages; chosen: a program that records several topics has said each of them by then
NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")
LARGEST_RECORD = 256 * 1024 * 1024  # [B] a length above it is of a damaged file


class BadRecording(ReasonedError, ValueError):
    """A file that is no recording; the reason has the file, what it is, and what would do."""


@dataclass(frozen=True)
class Row:
    """One message as it stands in the file."""

    channel: Channel
    schema: Schema
    message: Message

    @property
    def is_derived(self) -> bool:
        """True for what Foxglove shows: the same is in another channel."""
        return "derived" in self.channel.metadata


@dataclass
class Damage:
    """What of a file cannot be read; all zero and None where it is whole."""

    problem: Reason | None = None  # at the first place
    chunks: int = 0  # complete ones that do not agree with their CRC
    at: int = 0  # [B] where the complete records end
    lost: int = 0  # [B] behind that

    @property
    def is_any(self) -> bool:
        return self.problem is not None


@dataclass
class RecordingReader:
    """Reads one file, any number of times; raises `BadRecording` where it is none."""

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    damage: Damage = field(default_factory=Damage)
    profile: str = ""  # of its header

    def __post_init__(self) -> None:
        self.path = Path(self.path)
        require_recording(self.path)

    def rows(self, is_chosen: Callable[[str], bool] = lambda topic: True) -> Iterator[Row]:
        """The messages of the chosen topics in the order of the file; afterwards `damage` is known."""
        for record in self.records():
            if isinstance(record, Message):
                channel = self.channels[record.channel_id]
                if is_chosen(channel.topic):
                    yield Row(channel, self.schemas.get(channel.schema_id, NO_SCHEMA), record)

    def records(self) -> Iterator[Any]:
        """Every complete record of data, those of chunks one by one; afterwards `damage` is known."""
        self.damage = Damage()
        with self.path.open("rb") as file:
            yield from self._records(file)

    def require_own(self) -> None:
        """Raises `BadRecording` with what a recording of another program is, and what to do with it."""
        encodings = {row.channel.message_encoding for row in islice(self.rows(), LOOKED_AT)}
        if encodings and self.profile != PROFILE and METADATA not in self.metadata:
            topics = sorted({each.topic for each in self.channels.values()})
            raise BadRecording(reason_of(self.path, encodings, topics))

    def read_metadata(self) -> dict[str, dict[str, str]]:
        """Versions, deployment and the robot's files: those that come before the first hundred messages at least."""
        for number, _ in enumerate(self.rows()):
            if number >= 100:
                break
        return self.metadata

    def read_record(self, name: str, kind: type[S]) -> S | None:
        """The record `name` of the metadata; None where there is none; raises `BadRecording` where it is no `kind`."""
        text = self.read_metadata().get(name, {}).get("json", "")
        try:
            return msgspec.json.decode(text, type=kind) if text else None
        except msgspec.DecodeError as error:
            raise BadRecording(because("recording.record", file=str(self.path), name=name, error=str(error))) from error

    def _records(self, file: IO[bytes]) -> Iterator[Any]:
        """Complete records; those of chunks one by one."""
        size = self.path.stat().st_size
        records = iter(StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD).records)
        while True:
            self.damage.at = file.tell()
            try:
                record = next(records, None)
            except UNREADABLE as error:
                self.damage.lost = size - self.damage.at
                code = "recording.ends.in_record" if self.damage.lost else "recording.ends.before_index"
                self._damaged(because(code, error=type(error).__name__))
                return
            if record is None:
                return
            yield from self._unpacked(record)
            if isinstance(record, DataEnd):  # what follows is the index, which repeats
                file.seek(-len(MAGIC), SEEK_END)
                if file.read() != MAGIC:
                    self._damaged(because("recording.ends.in_index"))
                return

    def _unpacked(self, record: Any) -> Iterator[Any]:
        for each in self._chunk(record) if isinstance(record, Chunk) else (record,):
            match each:
                case Header():
                    self.profile = each.profile
                case Channel():
                    self.channels[each.id] = each
                case Schema():
                    self.schemas[each.id] = each
                case Metadata():
                    self.metadata[each.name] = dict(each.metadata)
                case Message() if each.channel_id not in self.channels:
                    self._damaged(because("recording.channel", channel=each.channel_id))
                    continue
            if isinstance(each, Channel | Schema | Metadata | Message | Attachment):
                yield each

    def _chunk(self, chunk: Chunk) -> list[Any]:
        try:
            return list(breakup_chunk(chunk, validate_crc=True))
        except Exception as error:  # zstd, lz4, struct and CRC have errors of their own
            self.damage.chunks += 1
            self._damaged(because("recording.chunk", error=type(error).__name__))
            return []

    def _damaged(self, problem: Reason) -> None:
        self.damage.problem = self.damage.problem or problem


def require_recording(path: Path) -> None:
    """Raises `BadRecording` with one sentence where `path` is no MCAP."""
    if path.is_dir():
        raise BadRecording(kind_of(path) or because("recording.folder", _newest(path), file=str(path)))
    if not path.exists():
        raise BadRecording(because("recording.none", _newest(path.parent), file=str(path)))
    try:
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except OSError as error:
        why = because("recording.unreadable", file=str(path), error=str(error.strerror or error))
        raise BadRecording(why) from error
    if not begin:
        raise BadRecording(because("recording.empty", file=str(path)))
    if begin != MAGIC:
        raise BadRecording(kind_of(path) or because("recording.not_one", file=str(path), begin=repr(begin)))


def _newest(folder: Path) -> Remedy:
    """The newest recording there."""
    found = sorted(folder.glob("*.mcap")) if folder.is_dir() else []
    return remedy("as_recording", file=str(found[-1])) if found else remedy("recordings_are_in")
