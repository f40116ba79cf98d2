"""A reader of MCAP files written from its specification (mcap.dev/spec) alone, and every way in which a file breaks it.

No library of MCAP has a part in it, so that what one of them writes is not held against itself.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

import lz4.frame
import zstandard

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = 0x0B, 0x0C, 0x0D, 0x0E, 0x0F
HEAD = struct.Struct("<BQ")  # opcode, and the length of what follows
FOOTER_SIZE = HEAD.size + 20


class Record(NamedTuple):
    """One record; `at` [B] is where it begins in the file, or in its chunk."""

    at: int
    opcode: int
    content: bytes

    @property
    def size(self) -> int:
        return HEAD.size + len(self.content)


class Message(NamedTuple):
    """As its record has it."""

    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class Fields:
    """The content of a record, from its beginning on."""

    def __init__(self, content: bytes) -> None:
        self._content, self._place = content, 0

    def take(self, form: str) -> int:
        (value,) = struct.unpack_from(f"<{form}", self._content, self._place)
        self._place += struct.calcsize(f"<{form}")
        return int(value)

    def bytes(self, form: str = "I") -> bytes:
        """As long as its own length says, which has this form."""
        size = self.take(form)
        self._place += size
        return self._content[self._place - size : self._place]

    def text(self) -> str:
        return self.bytes().decode("utf-8")

    def rest(self) -> bytes:
        return self._content[self._place :]


def records_of(data: bytes, begin: int = 0) -> Iterator[Record]:
    """All records of `data` from the byte `begin` to its end."""
    while begin < len(data):
        opcode, length = HEAD.unpack_from(data, begin)
        assert begin + HEAD.size + length <= len(data), f"the record at {begin} goes beyond the end"
        yield Record(begin, opcode, data[begin + HEAD.size : begin + HEAD.size + length])
        begin += HEAD.size + length


def message_of(content: bytes) -> Message:
    fields = Fields(content)
    return Message(fields.take("H"), fields.take("I"), fields.take("Q"), fields.take("Q"), fields.rest())


class Book:
    """A whole file; `problems` are sentences, none where it keeps to the specification."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.problems: list[str] = []
        self.topics: dict[int, str] = {}  # by channel
        self.schemas: dict[str, tuple[str, bytes]] = {}  # encoding and definition, by topic
        self.messages: list[Message] = []
        self._schemas: dict[int, tuple[str, bytes]] = {}
        self._chunks: dict[int, tuple[int, int, int]] = {}  # begin: its size, its first and its last time [ns]
        self._indexed: dict[int, dict[int, int]] = {}  # begin of a chunk: where the index of each channel is
        self._metadata: dict[int, tuple[int, str]] = {}  # begin: size and name
        self._said: Counter[int] = Counter()  # messages by channel
        if self._expect(data[:8] == MAGIC and data[-8:] == MAGIC, "the magic is missing at one end"):
            self._read()

    def _expect(self, is_true: bool, sentence: str) -> bool:
        if not is_true:
            self.problems.append(sentence)
        return is_true

    def _read(self) -> None:
        data = self._data
        footer = Fields(data[-8 - FOOTER_SIZE + HEAD.size : -8])
        summary, offsets, crc = footer.take("Q"), footer.take("Q"), footer.take("I")
        self._expect(zlib.crc32(data[summary:-12]) == crc, "the CRC of the summary is wrong")
        records = list(records_of(data[:-8], len(MAGIC)))
        self._expect(records[0].opcode == HEADER, "it does not begin with a header")
        self._expect(records[-1].opcode == FOOTER, "it does not end with a footer")
        (end,) = (each for each in records if each.opcode == DATA_END)
        self._expect(end.at + end.size == summary, "the summary does not begin behind the data")
        crc = Fields(end.content).take("I")
        self._expect(crc in (0, zlib.crc32(data[: end.at])), "the CRC of the data is wrong")  # 0: it has none
        self._data_section([each for each in records if each.at < end.at])
        self._summary([each for each in records if summary <= each.at < offsets])
        self._offsets([each for each in records if offsets <= each.at and each.opcode == SUMMARY_OFFSET], records)

    def _data_section(self, records: list[Record]) -> None:
        chunk, offsets = 0, dict[int, dict[int, int]]()  # of the present chunk: its place; times by channel and place
        for each in records:
            if each.opcode == CHUNK:
                chunk, offsets = each.at, self._chunk(each)
            elif each.opcode == MESSAGE_INDEX:
                fields = Fields(each.content)
                channel, entries = fields.take("H"), fields.bytes()
                found = {offset: time for time, offset in struct.iter_unpack("<QQ", entries)}
                self._expect(found == offsets.get(channel), f"the index of {channel} of the chunk at {chunk} is wrong")
                self._indexed.setdefault(chunk, {})[channel] = each.at
            elif each.opcode == METADATA:
                self._metadata[each.at] = (each.size, Fields(each.content).text())
            else:
                self._expect(each.opcode == HEADER, f"opcode {each.opcode} outside of a chunk")

    def _chunk(self, record: Record) -> dict[int, dict[int, int]]:
        """The times [ns] of the messages within, by channel and place."""
        fields = Fields(record.content)
        first, last, size, crc = fields.take("Q"), fields.take("Q"), fields.take("Q"), fields.take("I")
        compression, stored = fields.text(), fields.bytes("Q")
        self._chunks[record.at] = (record.size, first, last)
        content = _expanded(compression, stored, size)
        self._expect(len(content) == size, f"the chunk at {record.at} is not as large as it says")
        if not self._expect(zlib.crc32(content) == crc, f"the CRC of the chunk at {record.at} is wrong"):
            return {}
        offsets: dict[int, dict[int, int]] = {}
        times = []
        for each in records_of(content):
            if each.opcode == MESSAGE:
                message = message_of(each.content)
                self._expect(message.channel in self.topics, f"a message of channel {message.channel}, which is none")
                self.messages.append(message)
                self._said[message.channel] += 1
                offsets.setdefault(message.channel, {})[each.at] = message.log_time
                times.append(message.log_time)
            else:
                self._declaration(each)
        expected = (min(times, default=0), max(times, default=0))
        self._expect((first, last) == expected, f"the times of the chunk at {record.at} are wrong")
        return offsets

    def _declaration(self, record: Record) -> None:
        fields = Fields(record.content)
        number = fields.take("H")
        if record.opcode == SCHEMA:
            _, encoding, definition = fields.text(), fields.text(), fields.bytes()
            self._schemas[number] = (encoding, definition)
        elif self._expect(record.opcode == CHANNEL, f"opcode {record.opcode} within a chunk"):
            schema = fields.take("H")
            topic = self.topics[number] = fields.text()
            if self._expect(schema in self._schemas, f"{topic} has schema {schema}, which is none"):
                self.schemas[topic] = self._schemas[schema]

    def _summary(self, records: list[Record]) -> None:
        indexed, named = set[int](), set[int]()
        for each in records:
            fields = Fields(each.content)
            if each.opcode == CHUNK_INDEX:
                first, last, at, size = (fields.take("Q") for _ in range(4))
                indexed.add(at)
                self._expect(self._chunks.get(at) == (size, first, last), f"the index of the chunk at {at} is wrong")
                places = dict(struct.iter_unpack("<HQ", fields.bytes()))
                self._expect(places == self._indexed.get(at, {}), f"the indices behind the chunk at {at} are elsewhere")
            elif each.opcode == METADATA_INDEX:
                at, size, name = fields.take("Q"), fields.take("Q"), fields.text()
                named.add(at)
                self._expect(self._metadata.get(at) == (size, name), f"the index of the metadata at {at} is wrong")
            elif each.opcode == STATISTICS:
                self._statistics(fields)
        self._expect(indexed == set(self._chunks), "not every chunk is in the index")
        self._expect(named == set(self._metadata), "not all metadata is in the index")

    def _statistics(self, fields: Fields) -> None:
        counts = tuple(fields.take(form) for form in "QHIIII")
        found = (len(self.messages), len(self._schemas), len(self.topics), 0, len(self._metadata), len(self._chunks))
        self._expect(counts == found, f"the statistics say {counts}, the file has {found}")
        times = [message.log_time for message in self.messages]
        expected = (min(times, default=0), max(times, default=0))
        self._expect((fields.take("Q"), fields.take("Q")) == expected, "the statistics' times are wrong")
        by_channel = dict(struct.iter_unpack("<HQ", fields.bytes()))
        self._expect(by_channel == self._said, "the statistics' counts by channel are wrong")

    def _offsets(self, offsets: list[Record], records: list[Record]) -> None:
        for each in offsets:
            fields = Fields(each.content)
            opcode, begin, size = fields.take("B"), fields.take("Q"), fields.take("Q")
            group = [record for record in records if begin <= record.at < begin + size]
            is_whole = sum(record.size for record in group) == size and {record.opcode for record in group} <= {opcode}
            self._expect(is_whole, f"the group of opcode {opcode} at {begin} is none")


def _expanded(compression: str, stored: bytes, size: int) -> bytes:
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompress(stored, max_output_size=size)
    return bytes(lz4.frame.decompress(stored)) if compression == "lz4" else stored
