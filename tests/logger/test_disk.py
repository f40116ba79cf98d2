"""Rotation by size and age, and a disk that refuses: nothing dies, everything waits, losses are counted."""

import os
import resource
import signal

import pytest
from mcap.reader import make_reader

from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.system import LogRecord
from gemelo.schemas.topics import COMMAND_ACKS, COMMANDS, DESCRIPTION, JOINT_STATES, LOG
from gemelo.services.logger.core import Logger
from gemelo.services.logger.disk import RETRY, SHARE, LoggerParameters, RecordingWriter
from gemelo.services.logger.files import is_due, stem_of, surplus
from gemelo.tools.chaos.small_disk import BALLAST, SIZE
from tests.disks import refusing_disk

START = 1_795_000_000_000_000_000
SECOND = 1_000_000_000


class Rig:
    def __init__(self, folder, **parameters):
        self.folder = folder
        self.warnings = []
        self.logger = Logger()
        self.disk = RecordingWriter("rm1", {}, self.warnings.append)
        self.parameters = LoggerParameters(**parameters)

    def put(self, count, now, size=10):
        for index in range(count):
            state = JointState(stamp=now + index, name=("j" * size,), position=(0.5,))
            self.logger.on_message(JOINT_STATES, state, now + index)

    def write(self, now, monotonic=None):
        """`monotonic` [s] is that of `now` where no clock was set."""
        monotonic = now / 1e9 if monotonic is None else monotonic
        self.disk.write(self.logger, self.logger.step(now), self.folder, self.parameters, now, monotonic)

    def topics(self, path):
        with path.open("rb") as file:
            topics = [channel.topic for _, channel, _ in make_reader(file).iter_messages()]
        return [topic for topic in topics if not topic.startswith("foxglove/")]

    def recordings(self):
        return sorted(self.folder.glob("*.mcap"))


@pytest.fixture
def rig(tmp_path):
    rig = Rig(tmp_path / "log")
    yield rig
    rig.disk.close()


def test_files_are_named_by_utc_time_and_robot():
    assert stem_of("rm1", START + 250_000_000) == "20261118T110640.250Z_rm1"


def test_a_file_is_followed_by_a_new_one_when_it_is_large_or_old():
    assert not is_due(999_999, 59.0, max_file_mb=1, max_age_minutes=1)
    assert is_due(1_000_000, 0.0, max_file_mb=1, max_age_minutes=1)
    assert is_due(0, 60.0, max_file_mb=1, max_age_minutes=1)


def test_only_the_oldest_recordings_of_this_robot_are_surplus():
    names = [f"2026112{day}T000000.000Z_{robot}{kind}" for day in (1, 2, 3) for robot in ("rm1", "x") for kind in
             (".mcap", ".csv")] + ["notes.txt"]  # fmt: skip
    assert surplus(names, "rm1", 2) == ["20261121T000000.000Z_rm1.csv", "20261121T000000.000Z_rm1.mcap"]
    assert surplus(names, "rm1", 0) == []
    assert surplus(names, "rm1", 1, ("20261121T000000.000Z_rm1",)) == [
        f"2026112{day}T000000.000Z_rm1{kind}" for day in (2, 3) for kind in (".csv", ".mcap")
    ]


def test_age_rotates_both_files_and_each_begins_with_the_latched_messages(rig, chunk, ack):
    rig.parameters = LoggerParameters(max_age_minutes=1.0)
    rig.logger.on_message(DESCRIPTION, RobotDescription(robot="rm1"), START)
    for minute in range(3):
        now = START + minute * 60 * SECOND
        rig.put(2, now)
        rig.logger.on_message(COMMANDS, chunk(minute), now)
        rig.logger.on_message(COMMAND_ACKS, ack(minute), now)
        rig.write(now)
    rig.disk.close()
    expected = ["description", "joint_states", "joint_states", "commands", "command_acks"]
    assert [sorted(rig.topics(path)) for path in rig.recordings()] == [sorted(expected)] * 3
    assert [path.stem for path in rig.recordings()] == [path.stem for path in sorted(rig.folder.glob("*.csv"))]


def test_size_rotates_and_old_recordings_go(rig):
    rig.parameters = LoggerParameters(max_file_mb=0.005, keep_files=2)
    for index in range(6):
        rig.put(100, START + index * SECOND, size=4000 + index)
        rig.write(START + index * SECOND)
    assert len(rig.disk.files) > 3
    assert rig.recordings() == sorted(rig.disk.files)[-2:]


def test_an_unwritable_folder_is_said_once_and_nothing_is_lost(rig):
    rig.folder.write_text("a file where the folder should be")
    rig.put(10, START)
    rig.write(START)
    rig.put(10, START + SECOND)
    rig.write(START + SECOND)
    rig.write(START + SECOND)
    assert len(rig.warnings) == 1
    assert "log_dir" in rig.warnings[0]
    assert rig.disk.problem.code == "recording.unwritable"
    rig.folder.unlink()
    rig.write(START + round(2 * RETRY * SECOND))
    rig.disk.close()
    assert rig.topics(rig.recordings()[0]) == ["joint_states"] * 20
    assert not rig.disk.problem
    assert rig.logger.losses.sentence == ""


@pytest.fixture
def full_disk():
    """While the context lasts, no file of this process may grow: write() fails as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    previous = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def switch(is_full):
        resource.setrlimit(resource.RLIMIT_FSIZE, (0 if is_full else soft, hard))

    yield switch
    switch(False)
    signal.signal(signal.SIGXFSZ, previous)


def test_a_full_disk_loses_nothing_and_leaves_no_empty_files(rig, full_disk):
    rig.put(10, START)
    rig.write(START)
    full_disk(True)
    for second in range(1, 9):
        rig.put(10, START + second * SECOND)
        rig.write(START + second * SECOND)
    full_disk(False)
    assert len(rig.recordings()) == 1
    rig.write(START + 10 * SECOND)
    rig.disk.close()
    _, second = rig.recordings()
    assert len(rig.topics(second)) == 80
    assert len(rig.warnings) == 2, rig.warnings


def test_a_clock_that_is_set_back_by_an_hour_stops_no_recording(rig, full_disk):
    rig.parameters = LoggerParameters(max_age_minutes=1.0, keep_files=3)
    for minute in range(4):
        rig.put(10, START + minute * 60 * SECOND)
        rig.write(START + minute * 60 * SECOND, 60.0 * minute)
    back = START - 3600 * SECOND
    full_disk(True)
    rig.put(10, back)
    rig.write(back, 240.0)
    full_disk(False)
    rig.write(back + 2 * SECOND, 240.0 + RETRY)
    (now,) = [path for path in rig.recordings() if path.stem == stem_of("rm1", back + 2 * SECOND)]
    assert len(rig.recordings()) == 3
    rig.put(10, back + 63 * SECOND)
    rig.write(back + 63 * SECOND, 303.0)
    rig.disk.close()
    assert rig.topics(now) == ["joint_states"] * 10
    assert rig.topics(rig.folder / f"{stem_of('rm1', back + 63 * SECOND)}.mcap") == ["joint_states"] * 10


def test_recordings_leave_room_on_their_disk_and_go_on_when_there_is_more(tmp_path):
    with refusing_disk("full", tmp_path / "log") as small:
        rig = Rig(small.folder)
        rig.put(10, START)
        rig.write(START)
        assert rig.disk.problem is None
        small.refuse()
        with (small.folder / BALLAST).open("r+b") as ballast:
            ballast.truncate(ballast.seek(0, os.SEEK_END) - SIZE // SHARE // 2)  # half of the reserve is free
        rig.put(10, START + SECOND)
        rig.write(START + SECOND)
        (why,) = rig.disk.problem.causes
        assert (rig.disk.problem.code, why.code) == ("recording.unwritable", "recording.reserve")
        assert "reserve_mb" in str(rig.disk.problem)
        assert (small.folder / "the_rest").write_bytes(bytes(16 * 1024)) == 16 * 1024
        small.take()
        rig.write(START + 4 * SECOND)
        rig.disk.close()
        assert rig.disk.problem is None
        assert [each for path in rig.recordings() for each in rig.topics(path)] == ["joint_states"] * 20
        assert rig.logger.losses.sentence == ""


def test_a_folder_that_is_deleted_is_made_again(rig):
    rig.put(1, START)
    rig.write(START)
    for path in rig.folder.iterdir():
        path.unlink()
    rig.folder.rmdir()
    rig.put(3, START + SECOND)
    rig.write(START + SECOND)
    rig.disk.close()
    assert len(rig.topics(rig.recordings()[0])) == 3


def test_when_memory_is_full_states_go_before_commands_and_are_counted(chunk):
    logger = Logger(max_waiting=10)
    logger.on_message(COMMANDS, chunk(0), START)
    logger.on_message(LOG, LogRecord(text="x"), START)
    for index in range(20):
        logger.on_message(JOINT_STATES, JointState(stamp=index + 1), START)
    batch = logger.step(START)
    assert [entry.topic.key for entry in batch.entries[:2]] == ["commands", "log"]
    assert len(batch.entries) <= 10
    assert logger.losses.dropped == {"joint_states": 22 - len(batch.entries)}
    assert "of `joint_states`" in logger.losses.sentence
