"""An ordinary recording as readers take it that are not ours: Rerun's, in Rust, and one by the specification alone."""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import jsonschema
import pytest
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import CompressionType
from rerun.chunk import McapReader

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.repair import repair
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.schemas.joints import JointState
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import DESCRIPTION, JOINT_STATES, LOG
from gemelo.services.state_publisher.main import describe
from tests.logger.mcap_by_the_book import CHUNK, MESSAGE_INDEX, Book, records_of

ROOT = Path(__file__).parents[2]
START, PERIOD = 1_795_000_000_000_000_000, 20_000_000  # [ns]
OF_A_STACK = sorted((ROOT / "tests/replay/recordings").glob("*.mcap"))  # the logger's, of whole moves
MADE = [*CompressionType, "repaired"]
Said = tuple[int, int, bytes]  # log time and publish time [ns], content


def made(path: Path, compression: CompressionType) -> Path:
    """Ten chunks, the last of them with two topics more; the times of one topic are not in order."""
    file = McapFile(path, {"gemelo": {"robot": "rm1"}}, recorded_topics(), compression)
    file.write([Entry(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")), START)])
    for chunk in range(9):
        states = [JointState(stamp=START + k, name=("a", "b"), position=(k / 7, -0.5)) for k in range(25)]
        file.write(Entry(JOINT_STATES, each, START + (25 * chunk + k) * PERIOD) for k, each in enumerate(states))
        file.write([Entry(LOG, LogRecord(stamp=START + 1, node="a", text="ñ 你"), START + (25 * chunk + 24) * PERIOD)])
    file.close()
    return path


@pytest.fixture(params=[*OF_A_STACK, *MADE], ids=lambda each: each.stem if isinstance(each, Path) else str(each))
def recording(request, tmp_path) -> Path:
    if isinstance(request.param, Path):
        return request.param
    if request.param != "repaired":
        return made(tmp_path / "made.mcap", request.param)
    whole = made(tmp_path / "whole.mcap", CompressionType.ZSTD)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    repair(cut, tmp_path / "made.mcap")
    return tmp_path / "made.mcap"


def by_topic(said: Iterator[tuple[str, Said]]) -> dict[str, list[Said]]:
    """In the order of their times: what is indexed is read in that one."""
    found: dict[str, list[Said]] = {}
    for topic, each in said:
        found.setdefault(topic, []).append(each)
    return {topic: sorted(each) for topic, each in found.items()}


def by_the_book(path: Path) -> dict[str, list[Said]]:
    book = Book(path.read_bytes())
    assert book.problems == []
    return by_topic((book.topics[m.channel], (m.log_time, m.publish_time, m.data)) for m in book.messages)


def by_rust(path: Path) -> dict[str, list[Said]]:
    def said() -> Iterator[tuple[str, Said]]:
        for chunk in McapReader(path, decoders=["raw"]).stream():
            batch = chunk.to_record_batch()
            times = (batch.column(f"message_{name}_time").cast("int64").to_pylist() for name in ("log", "publish"))
            for log_time, publish_time, (data,) in zip(
                *times, batch.column("McapMessage:data").to_pylist(), strict=True
            ):
                yield chunk.entity_path[1:].replace("\\", ""), (log_time, publish_time, bytes(data))

    return by_topic(said())


def test_a_recording_keeps_to_the_specification_and_rust_reads_every_message_of_it(recording):
    expected = by_the_book(recording)
    assert sum(map(len, expected.values())) > 25
    assert by_rust(recording) == expected


def test_rust_finds_the_index_the_counts_and_the_times(recording):
    info = McapReader(recording).info()
    expected = by_the_book(recording)
    assert info.profile == "gemelo"
    assert info.summary_source == "embedded"
    assert not info.chunks.has_overlapping_time_ranges
    assert {each.topic: each.message_count for each in info.channels if each.message_count} == {
        topic: len(said) for topic, said in expected.items()
    }
    times = [log_time for said in expected.values() for log_time, _, _ in said]
    assert (info.message_start_time_ns, info.message_end_time_ns) == (min(times), max(times))
    assert all(each.schema is not None and each.schema.encoding == "jsonschema" for each in info.channels)


def test_a_window_of_time_is_found_by_the_index(recording):
    """Rust reads only the chunks that the index names."""
    topic, expected = max(by_the_book(recording).items(), key=lambda each: len(each[1]))
    begin, end = expected[len(expected) // 3][0], expected[len(expected) // 2][0]
    reader = McapReader(recording, decoders=["raw"], include_topic_regex=[f"^{topic}$"])
    rows = sum(chunk.num_rows for chunk in reader.stream(start_time_ns=begin, end_time_ns=end))
    assert rows == sum(begin <= log_time < end for log_time, _, _ in expected) > 5


def test_every_message_is_what_the_files_own_schema_of_its_topic_says(recording):
    book = Book(recording.read_bytes())
    validators = {}
    for topic, (encoding, definition) in book.schemas.items():
        assert encoding == "jsonschema"
        schema = json.loads(definition)
        jsonschema.Draft202012Validator.check_schema(schema)
        validators[topic] = jsonschema.Draft202012Validator(schema)
    seen: Counter[str] = Counter()
    for message in book.messages:
        topic = book.topics[message.channel]
        seen[topic] += 1
        if seen[topic] <= 40:  # of each topic: it is slow
            validators[topic].validate(json.loads(message.data))
    assert set(seen) == set(by_the_book(recording))


@pytest.mark.parametrize("kind", [SeekingReader, NonSeekingReader])
def test_python_reads_the_same_with_every_crc_checked(recording, kind):
    with recording.open("rb") as file:
        rows = kind(file, validate_crcs=True).iter_messages()
        said = by_topic((channel.topic, (m.log_time, m.publish_time, m.data)) for _, channel, m in rows)
    assert said == by_the_book(recording)


@cache
def healthy() -> bytes:
    return OF_A_STACK[0].read_bytes()


def test_damage_anywhere_is_a_problem_by_the_book():
    """So the book would have said it."""
    data = healthy()
    records = list(records_of(data[:-8], 8))
    chunk = next(each for each in records if each.opcode == CHUNK)
    index = next(each for each in records if each.opcode == MESSAGE_INDEX)
    (channel,) = struct.unpack_from("<H", index.content)
    places = {
        chunk.at + 9 + 8: f"the times of the chunk at {chunk.at} are wrong",
        chunk.at + 9 + 24: f"the CRC of the chunk at {chunk.at} is wrong",
        index.at + 9 + 6: f"the index of {channel} of the chunk at {chunk.at} is wrong",
        len(data) - 8 - 30: "the CRC of the summary is wrong",
        3: "the magic is missing at one end",
    }
    for place, sentence in places.items():
        damaged = bytearray(data)
        damaged[place] ^= 1
        assert sentence in Book(bytes(damaged)).problems


def test_rust_refuses_a_file_that_was_cut_off(tmp_path):
    """Of a damaged chunk it says so, and then sometimes never ends: that is not asked of it."""
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(OF_A_STACK[0].read_bytes()[:-1000])
    with pytest.raises(ValueError, match=r"(?i)mcap|footer|magic|summary"):
        McapReader(cut).info()
