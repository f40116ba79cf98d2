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

from gemelo.libraries.recordings.foreign import METADATA, PROFILE, kind_of, sentence_of

S = TypeVar("S", bound=msgspec.Struct)

MAGIC = b"\x89MCAP0\r\n"
UNREADABLE = (McapError, struct.error, ValueError, EOFError, OSError, KeyError, IndexError, MemoryError)
LOOKED_AT = 1000  # messages; chosen: a program that records several topics has said each of them by then
NO_SCHEMA = Schema(id=0, name="", encoding="", data=b"")
LARGEST_RECORD = 256 * 1024 * 1024  # [B] a length above it is of a damaged file


class BadRecording(ValueError):
    """A file that is no recording; one sentence with the file, what it is, and what would do."""


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
    """What of a file cannot be read; all zero and empty where it is whole."""

    problem: str = ""  # at the first place
    chunks: int = 0  # complete ones that do not agree with their CRC
    at: int = 0  # [B] where the complete records end
    lost: int = 0  # [B] behind that

    @property
    def is_any(self) -> bool:
        return bool(self.problem)


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
            said = sentence_of(encodings, sorted({each.topic for each in self.channels.values()}))
            raise BadRecording(f'"{self.path}" {said}; `gemelo bag info {self.path}` lists it')

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
            raise BadRecording(f'"{self.path}": its {name} cannot be read ({error})') from error

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
                where = "in the middle of a record" if self.damage.lost else "before its index"
                self._damaged(f"it ends {where} ({type(error).__name__})")
                return
            if record is None:
                return
            yield from self._unpacked(record)
            if isinstance(record, DataEnd):  # what follows is the index, which repeats
                file.seek(-len(MAGIC), SEEK_END)
                if file.read() != MAGIC:
                    self._damaged("it ends in the middle of its index")
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
                    self._damaged(f"a message is of channel {each.channel_id}, which is not described")
                    continue
            if isinstance(each, Channel | Schema | Metadata | Message | Attachment):
                yield each

    def _chunk(self, chunk: Chunk) -> list[Any]:
        try:
            return list(breakup_chunk(chunk, validate_crc=True))
        except Exception as error:  # zstd, lz4, struct and CRC have errors of their own
            self.damage.chunks += 1
            self._damaged(f"a chunk is damaged ({type(error).__name__})")
            return []

    def _damaged(self, problem: str) -> None:
        self.damage.problem = self.damage.problem or problem


def require_recording(path: Path) -> None:
    """Raises `BadRecording` with one sentence where `path` is no MCAP."""
    if path.is_dir() and (kind := kind_of(path)):
        raise BadRecording(f'"{path}" {kind}')
    if path.is_dir():
        raise BadRecording(f'"{path}" is a folder: name one file in it{_newest(path)}')
    if not path.exists():
        raise BadRecording(f'there is no file "{path}"{_newest(path.parent)}')
    try:
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except OSError as error:
        raise BadRecording(f'"{path}" cannot be read: {error.strerror or error}') from error
    if not begin:
        raise BadRecording(f'"{path}" is empty: it was cut off before anything was written; nothing can be saved of it')
    if begin != MAGIC and (kind := kind_of(path)):
        raise BadRecording(f'"{path}" {kind}')
    if begin != MAGIC:
        raise BadRecording(
            f'"{path}" is no MCAP recording: it begins with {begin!r}; recordings are the files that end with .mcap'
        )


def _newest(folder: Path) -> str:
    """The newest recording there, as a remedy."""
    found = sorted(folder.glob("*.mcap")) if folder.is_dir() else []
    return f", as {found[-1]}" if found else "; recordings are in <out>/recordings"
