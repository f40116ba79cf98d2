"""Recordings afterwards: read, repaired, exported and played; read back by the MCAP library where it is a file."""

import csv
import json
import os
import random
import subprocess
from io import BytesIO

import msgspec
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.records import Message as McapMessage
from mcap.stream_reader import StreamReader, breakup_chunk

from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.contents import contents_of
from gemelo.libraries.recordings.export import NothingToExport, chosen, export
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.recordings.player import Player, Roles, payload_of
from gemelo.libraries.recordings.reader import BadRecording, RecordingReader
from gemelo.libraries.recordings.repair import repair
from gemelo.libraries.recordings.shadow import recorded_robot, write_shadow
from gemelo.libraries.recordings.table import exchanges_of, recorded_topics
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import decode, encode
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import DESCRIPTION, JOINT_STATES, LOG, PLAN
from gemelo.services.logger.command_log import CommandRow
from gemelo.services.logger.recording import Recording
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from tests.schemas.samples import sample
from tests.table import table

START = 1_795_000_000_000_000_000
PERIOD = 20_000_000  # [ns]
ROBOT = RobotDescription(robot="rm1", urdf="<robot name='rm1'/>", srdf="<robot/>", robot_toml='name = "rm1"\n')


def state(index):
    return JointState(stamp=START + index * PERIOD, name=("a", "b"), position=(0.001 * index, -0.5))


def recording(path, count=200, batch=10):
    """The robot, then `count` joint states at 50 Hz, written every `batch`."""
    file = McapFile(path, {"gemelo": {"robot": "rm1"}})
    file.write([Entry(DESCRIPTION, ROBOT, START)])
    for begin in range(0, count, batch):
        file.write(Entry(JOINT_STATES, state(k), START + k * PERIOD) for k in range(begin, begin + batch))
    file.close()
    return path


@pytest.fixture
def bag(tmp_path):
    return recording(tmp_path / "bag.mcap")


def stamps(path):
    """Of the joint states, by the library's own reader."""
    with path.open("rb") as file:
        return [
            json.loads(m.data)["stamp"] for _, c, m in make_reader(file).iter_messages() if c.topic == "joint_states"
        ]


def stamps_of_complete_chunks(content):
    """What the library can read of the chunks that are whole: by its streaming reader, up to where it fails."""
    found, topics = [], {}
    try:
        for record in StreamReader(BytesIO(content), emit_chunks=True).records:
            for each in breakup_chunk(record) if isinstance(record, Chunk) else [record]:
                if hasattr(each, "topic"):
                    topics[each.id] = each.topic
                elif isinstance(each, McapMessage) and topics[each.channel_id] == "joint_states":
                    found.append(json.loads(each.data)["stamp"])
    except Exception:
        pass
    return found


@pytest.mark.parametrize("seed", range(12))
def test_a_file_cut_off_anywhere_is_repaired_to_every_complete_chunk(bag, tmp_path, seed):
    content = bag.read_bytes()
    cut = random.Random(seed).randrange(200, len(content) - 200)
    broken, whole = tmp_path / "broken.mcap", tmp_path / "whole.mcap"
    broken.write_bytes(content[:cut])
    repaired = repair(broken, whole)
    expected = stamps_of_complete_chunks(content[:cut])
    assert stamps(whole) == expected
    assert repaired.saved["joint_states"] == len(expected)
    assert not contents_of(whole).damage
    assert contents_of(broken).damage
    saved, lost = repaired.reasons
    assert saved.values["count"] == repaired.saved.total()
    assert lost.code in ("recording.lost", "recording.lost.nothing")


def test_a_chunk_that_is_damaged_within_costs_itself_alone(bag, tmp_path):
    content = bytearray(bag.read_bytes())
    offsets = [index.chunk_start_offset for index in summary_of(bag).chunk_indexes]
    content[offsets[5] + 80] ^= 0xFF
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(bytes(content))
    repaired = repair(broken, tmp_path / "whole.mcap")
    assert repaired.damage.chunks == 1
    assert len(stamps(tmp_path / "whole.mcap")) == 190


def summary_of(path):
    with path.open("rb") as file:
        return make_reader(file).get_summary()


def test_the_contents_are_the_same_with_and_without_the_index(bag, tmp_path):
    cut = tmp_path / "cut.mcap"
    footer = summary_of(bag)
    last = max(index.chunk_start_offset + index.chunk_length for index in footer.chunk_indexes)
    cut.write_bytes(bag.read_bytes()[:last])
    whole, read = contents_of(bag), contents_of(cut)
    assert (whole.messages, whole.topics, whole.start, whole.duration) == (201, read.topics, read.start, read.duration)
    assert [each.topic for each in whole.topics] == ["description", "joint_states"]
    assert whole.duration == pytest.approx(199 * 0.02)
    assert not whole.damage
    assert "gemelo bag repair" in read.damage


@pytest.mark.parametrize(
    ("content", "said"),
    [(None, "there is no file"), (b"", "is empty"), (b"\x89PNG\r\n\x1a\n", "is no MCAP"), ("folder", "is a folder")],
)
def test_what_is_no_recording_is_refused_with_its_name_and_a_remedy(tmp_path, content, said):
    path = tmp_path / "odd.mcap"
    if content == "folder":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(BadRecording, match=said) as refusal:
        contents_of(path)
    assert str(path) in str(refusal.value)


def test_the_tables_have_every_number_that_was_recorded(bag, tmp_path):
    ((path, rows),) = export(bag, "csv", ["joint_*"], tmp_path / "tables")
    with path.open(newline="") as file:
        read = list(csv.DictReader(file))
    assert len(read) == rows == 200
    assert list(read[0])[:3] == ["log_time", "publish_time", "stamp"]
    assert [float(row["position[0]"]) for row in read] == [state(k).position[0] for k in range(200)]
    assert {row["name[1]"] for row in read} == {"b"}


def test_parquet_has_the_same_numbers_by_its_own_reader(bag, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    files = dict(export(bag, "parquet", [], tmp_path / "tables"))
    table = parquet.read_table(next(path for path in files if path.stem == "joint_states"))
    assert table.column("position[0]").to_pylist() == [state(k).position[0] for k in range(200)]
    assert table.column("log_time").to_pylist() == [START + k * PERIOD for k in range(200)]


def test_rerun_reads_the_curves_of_its_file(bag, tmp_path):
    """By Rerun's own program."""
    ((path, _),) = export(bag, "rerun", [], tmp_path / "bag.rrd")
    done = subprocess.run([rerun_binary(), "rrd", "print", "-v", path], capture_output=True, text=True, check=True)
    assert "position[0]" in done.stdout.replace("\\", "")


def test_a_recording_and_what_is_made_of_it_are_its_owners_alone(bag, tmp_path):
    """Whatever the umask: another user of the host reads none of it."""
    before = os.umask(0)
    try:
        (tmp_path / "plain").write_text("")
        assert (tmp_path / "plain").stat().st_mode & 0o777 == 0o666, "what a file gets without our care"
        own = Recording(tmp_path, "own", {})
        own.write_lines([CommandRow(("a",), ("",))])
        own.abandon()
        repair(bag, tmp_path / "repaired.mcap")
        made = [tmp_path / "repaired.mcap", own.path, own.csv_path]
        for form, where in (("csv", "tables"), ("parquet", "columns"), ("rerun", "bag.rrd")):
            made += [path for path, _ in export(bag, form, ["joint_*"], tmp_path / where)]
    finally:
        os.umask(before)
    assert len(made) == 6
    assert {oct(path.stat().st_mode & 0o777) for path in made} == {"0o600"}
    assert oct((tmp_path / "tables").stat().st_mode & 0o777) == "0o700"


def test_a_pattern_that_matches_nothing_is_named_with_what_there_is(bag):
    with pytest.raises(NothingToExport, match='no topic matches "devise": there is description'):
        list(export(bag, "csv", ["devise"], None))
    assert chosen(["a/b", "c"], ["a/*"]) == {"a/b"}


@table("topic", recorded_topics(), ids=lambda topic: topic.key)
def test_what_is_played_is_what_was_said_to_the_byte(topic, tmp_path):
    message = sample(topic.message)
    file = McapFile(tmp_path / f"{topic.key.replace('/', '.')}.mcap", {})
    file.write([Entry(topic, message, START)])
    file.close()
    (row,) = [row for row in RecordingReader(file.path).rows() if not row.is_derived]
    assert payload_of(row) == encode(message)


def test_a_players_time_is_the_recordings_own_times_the_rate(bag):
    player = Player(RecordingReader(bag), lambda topic: topic == "joint_states", rate=2.0)
    played = [len(list(player.due(0.125))) for _ in range(8)]
    assert sum(played) == 101  # 2 s of 50 Hz, and the first
    player.is_paused = True
    assert not list(player.due(5.0))
    assert [json.loads(row.message.data)["stamp"] for row in player.step()] == [START + 101 * PERIOD]
    player.is_paused = False
    assert len(list(player.due(100.0))) == 200 - 102
    assert player.is_over


def test_a_player_that_starts_in_the_middle_says_first_what_is_latched(bag):
    player = Player(RecordingReader(bag), start=2.0)
    first, second = list(player.due(0.0))
    assert (first.channel.topic, second.channel.topic) == ("description", "joint_states")
    assert json.loads(second.message.data)["stamp"] == START + 100 * PERIOD


def test_a_loop_begins_again_with_the_same_messages(bag):
    player = Player(RecordingReader(bag), loop=True)
    rounds = [[row.message.sequence for row in player.due(10.0)] for _ in range(3)]
    assert rounds[0] == rounds[1] == rounds[2]
    assert len(rounds[0]) == 201


def test_a_recording_never_speaks_for_a_robot_that_lives(bag):
    network = MemoryNetwork()
    roles = Roles(MemoryBus(network))
    with Node("stepper_gateway", bus=MemoryBus(network)), pytest.raises(NodeNameTaken, match="stepper_gateway"):
        roles.claim(Player(RecordingReader(bag)).writers)


def test_no_robot_starts_under_a_name_that_is_being_played(bag):
    network = MemoryNetwork()
    Roles(MemoryBus(network)).claim(Player(RecordingReader(bag)).writers)
    with pytest.raises(NodeNameTaken, match="stepper_gateway"):
        Node("stepper_gateway", bus=MemoryBus(network))


def test_readers_take_what_is_played_latched_messages_too(bag):
    network = MemoryNetwork()
    player = Player(RecordingReader(bag))
    roles = Roles(MemoryBus(network))
    roles.claim(player.writers)
    with Node("viewer", bus=MemoryBus(network)) as viewer:
        heard = []
        viewer.subscribe(JOINT_STATES, heard.append, batch=0.01)
        for row in player.due(10.0):
            roles.put(row)
        latest = viewer.latest(DESCRIPTION)
        viewer.wait(0.1)
    assert latest.message == ROBOT
    assert heard == [state(k) for k in range(200)]


def test_the_shadows_folder_has_the_recorded_files_under_its_own_name(bag, tmp_path):
    reader = RecordingReader(bag)
    assert recorded_robot(reader) == "rm1"
    write_shadow(reader, tmp_path / "shadow", "rm1-replay", tmp_path)
    assert (tmp_path / "shadow/robot.toml").read_text() == 'name = "rm1-replay"\n'
    assert (tmp_path / "shadow/robot.urdf").read_text() == ROBOT.urdf


def test_a_file_that_names_another_folder_is_refused(tmp_path):
    file = McapFile(tmp_path / "evil.mcap", {})
    text = 'name = "rm1"\nurdf = "../../../etc/cron.d/x"\n'
    file.write([Entry(DESCRIPTION, RobotDescription(robot="rm1", urdf="<robot/>", robot_toml=text), START)])
    file.close()
    reader = RecordingReader(file.path)
    assert recorded_robot(reader) == "rm1"
    with pytest.raises(BadRecording, match="another folder"):
        write_shadow(reader, tmp_path / "shadow", "x", tmp_path)


def test_a_users_message_comes_back_with_its_numbers(tmp_path):
    exchange = exchanges_of(PLAN)
    asked = msgspec.convert({"question": {"velocity_scaling": 0.5}, "clients": ["a"]}, exchange.message)
    file = McapFile(tmp_path / "plan.mcap", {})
    file.write([Entry(exchange, asked, START), Entry(LOG, LogRecord(text="t"), START)])
    file.close()
    (row,) = RecordingReader(file.path).rows(lambda topic: topic == exchange.key)
    assert decode(exchange.message, payload_of(row)) == asked
