"""Recordings can be read: by the MCAP reader, by a streaming reader after kill -9, and as CSV."""

import csv
import json
import os
import signal
import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile, InvalidMagic
from mcap.reader import make_reader
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader

from gemelo.libraries.recordings import foxglove
from gemelo.libraries.recordings.channels import Entry, channel_of, schema_of
from gemelo.libraries.recordings.table import recorded_topics
from gemelo.schemas.frames import FrameTransform, FrameTransforms, RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, FRAMES, JOINT_STATES, TOPICS
from gemelo.services.logger.command_log import CommandRow
from gemelo.services.logger.recording import Recording
from tests.table import table

START = 1_795_000_000_000_000_000


def joint_state(index):
    return JointState(stamp=START + index * 20_000_000, name=("a", "b"), position=(0.001 * index, -0.5))


@pytest.fixture
def recording(tmp_path):
    recording = Recording(tmp_path, "test", {"gemelo": {"robot": "rm1"}})
    yield recording
    recording.abandon()


@table("topic", TOPICS, ids=lambda topic: topic.key)
def test_every_schema_stands_alone(topic):
    text = schema_of(topic.message).decode()
    schema = json.loads(text)
    assert "$ref" not in text
    assert schema["type"] == "object"
    assert set(schema["properties"]) == set(topic.message.__struct_fields__)


@table("topic", recorded_topics(), ids=lambda topic: topic.key)
def test_every_channel_that_is_recorded_has_a_schema_that_ends_where_a_kind_holds_itself(topic):
    """A reason holds its causes, which are reasons."""
    assert b"$ref" not in channel_of(topic).schema


def test_messages_come_back_with_both_times_and_their_schema(recording):
    state = joint_state(3)
    recording.write([Entry(JOINT_STATES, state, START + 61_000_000)])
    recording.close()
    with recording.path.open("rb") as file:
        ((schema, channel, message),) = list(make_reader(file).iter_messages())
    assert (schema.name, schema.encoding, channel.topic) == ("JointState", "jsonschema", "joint_states")
    assert channel.message_encoding == "json"
    assert channel.metadata["rate_hz"] == "50"
    assert (message.log_time, message.publish_time) == (START + 61_000_000, state.stamp)
    assert json.loads(message.data)["position"] == [0.003, -0.5]


def test_a_message_without_a_stamp_of_its_own_is_published_when_it_arrives():
    entry = Entry(FRAMES, FrameTransforms(transforms=(FrameTransform(stamp=5),)), START)
    assert entry.stamp == START


def test_every_recorded_topic_has_a_channel(recording):
    recording.write([Entry(JOINT_STATES, joint_state(0), START)])
    recording.close()
    with recording.path.open("rb") as file:
        summary = make_reader(file).get_summary()
    shown = {channel.key for channel in foxglove.channels()}
    assert {channel.topic for channel in summary.channels.values()} == {
        topic.key for topic in recorded_topics()
    } | shown


def test_the_robots_files_and_the_origin_are_kept_beside_the_data(recording):
    description = RobotDescription(robot="rm1", urdf="<robot/>", srdf="<s/>", robot_toml="name='rm1'")
    recording.write([Entry(DESCRIPTION, description, START), Entry(DESCRIPTION, description, START + 1)])
    recording.close()
    with recording.path.open("rb") as file:
        kept = [(record.name, record.metadata) for record in make_reader(file).iter_metadata()]
    assert [name for name, _ in kept] == ["gemelo", "robot"]
    assert kept[0][1]["robot"] == "rm1"
    assert kept[1][1]["urdf"] == "<robot/>"


def test_the_table_of_commands_is_plain_csv(recording):
    rows = [CommandRow(("a",), ("0", "1")), CommandRow(("a",), ("1", "2")), CommandRow(("b", "c"), ("7", "8"))]
    recording.write_lines(rows)
    recording.write_lines([CommandRow(("a",), ("2", "3"))])
    recording.close()
    rows = list(csv.reader(recording.csv_path.read_text().splitlines()))
    assert rows[0][:4] == ["seq", "timestamp_pc_us", "timestamp_pc_iso", "a_pos"]
    assert [row[0] for row in rows[1:]] == ["0", "1", "2"]
    other = recording.csv_path.with_name("test_2.csv").read_text().splitlines()
    assert "b_pos" in other[0]
    assert other[1] == "7,8"


WRITER = """
import sys, time
from pathlib import Path
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.logger.command_log import CommandRow
from gemelo.services.logger.recording import Recording
from gemelo.libraries.recordings.channels import Entry
recording = Recording(Path(sys.argv[1]), "killed", {})
count = 0
while True:
    batch = [Entry(JOINT_STATES, JointState(stamp=count + k + 1, name=("a",)), count + k + 1) for k in range(100)]
    recording.write(batch)
    count += 100
    print(count, flush=True)
    time.sleep(0.01)
"""


def test_kill_9_loses_nothing_that_was_written(tmp_path):
    root = Path(str(files("gemelo"))).parent
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path)], stdout=subprocess.PIPE, text=True, cwd=root
    ) as writer:
        while int(writer.stdout.readline()) < 1500:
            pass
        os.kill(writer.pid, signal.SIGKILL)
        printed = [int(line) for line in writer.stdout.read().split()]
    written = max([1500, *printed])
    stamps = recovered(tmp_path / "killed.mcap")
    assert len(stamps) >= written
    assert stamps == list(range(1, len(stamps) + 1))


def recovered(path):
    """Publish times of all messages that a streaming reader finds before the file breaks off."""
    stamps = []
    with path.open("rb") as file, pytest.raises((EndOfFile, InvalidMagic)):
        stamps.extend(record.publish_time for record in StreamReader(file).records if isinstance(record, McapMessage))
    return stamps


def test_the_description_is_json_too(recording):
    recording.write([Entry(DESCRIPTION, RobotDescription(robot="rm1", urdf="<robot name='rm1'/>"), START)])
    recording.close()
    with recording.path.open("rb") as file:
        ((_, _, message),) = list(make_reader(file).iter_messages(topics=["description"]))
    assert json.loads(message.data)["urdf"] == "<robot name='rm1'/>"
