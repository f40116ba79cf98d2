"""A recording that was cut off, written anew: every message of every complete chunk, and the index that was missing."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.writer import CompressionType, Writer

from gemelo.libraries.recordings.foreign import PROFILE
from gemelo.libraries.recordings.mcap_file import CHUNK_SIZE
from gemelo.libraries.recordings.reader import Damage, RecordingReader
from gemelo.libraries.runtime.process.own_files import own_file
from gemelo.schemas.reasons import Reason, because


@dataclass
class Repaired:
    """What was saved, and what was not."""

    path: Path
    damage: Damage
    saved: Counter[str] = field(default_factory=Counter)  # messages by topic
    first: int = 0  # [ns] UNIX arrival of the first message that is saved
    last: int = 0  # and of the last

    @property
    def reasons(self) -> tuple[Reason, Reason]:
        """What is saved, and what is lost."""
        length, file = (self.last - self.first) / 1e9, str(self.path)
        count, topics = self.saved.total(), len(self.saved)
        saved = because("recording.saved", count=count, topics=topics, length=length, file=file)
        parts = [because("recording.lost.end", size=self.damage.lost)] if self.damage.lost else []
        parts += [because("recording.lost.chunks", count=self.damage.chunks)] if self.damage.chunks else []
        return saved, because("recording.lost", *parts) if parts else because("recording.lost.nothing")


def repair(source: Path, target: Path) -> Repaired:
    """Writes `target`; raises `BadRecording` where `source` is none, FileExistsError, or OSError of the disk."""
    reader = RecordingReader(source)
    repaired = Repaired(target, reader.damage)
    with open(target, "xb", opener=own_file) as file:
        writer = Writer(file, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        writer.start(profile=PROFILE)
        copy = _Copy(writer, repaired)
        for record in reader.records():
            copy.add(record)
        writer.finish()
    repaired.damage = reader.damage
    return repaired


class _Copy:
    """Writes records as they come, with numbers of the new file's own for channels and schemas."""

    def __init__(self, writer: Writer, repaired: Repaired) -> None:
        self._writer, self._repaired = writer, repaired
        self._schemas: dict[int, int] = {0: 0}
        self._channels: dict[int, tuple[int, str]] = {}  # the new number, and the topic

    def add(self, record: object) -> None:
        match record:
            case Schema() if record.id not in self._schemas:
                self._schemas[record.id] = self._writer.register_schema(record.name, record.encoding, record.data)
            case Channel() if record.id not in self._channels:
                schema = self._schemas.get(record.schema_id, 0)
                number = self._writer.register_channel(
                    record.topic, record.message_encoding, schema, dict(record.metadata)
                )
                self._channels[record.id] = number, record.topic
            case Metadata():
                self._writer.add_metadata(record.name, dict(record.metadata))
            case Attachment():
                self._writer.add_attachment(
                    record.create_time, record.log_time, record.name, record.media_type, record.data
                )
            case Message():
                self._message(record)

    def _message(self, record: Message) -> None:
        number, topic = self._channels[record.channel_id]
        self._writer.add_message(number, record.log_time, record.data, record.publish_time, record.sequence)
        self._repaired.saved[topic] += 1
        self._repaired.first = min(self._repaired.first or record.log_time, record.log_time)
        self._repaired.last = max(self._repaired.last, record.log_time)
