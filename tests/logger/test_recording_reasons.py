"""Files that are no recording, and recordings that end early: the code and the values of each cause."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gemelo.libraries.recordings.export import NothingToExport, chosen
from gemelo.libraries.recordings.foreign import kind_of, reason_of
from gemelo.libraries.recordings.reader import MAGIC, BadRecording, RecordingReader
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.recording.bag_play import refused, require_name

ROS2 = remedy("play_with_ros2")


def empty(path: Path) -> Reason:
    path.write_bytes(b"")
    return because("recording.empty", file=str(path))


def not_one(path: Path) -> Reason:
    path.write_bytes(b"words, words")
    return because("recording.not_one", file=str(path), begin="b'words, w'")


def rosbag(path: Path) -> Reason:
    path.write_bytes(b"#ROSBAG V2.0\n")
    return because("recording.other_form", remedy("convert_rosbags"), file=str(path), kind="rosbag")


def absent(path: Path) -> Reason:
    return because("recording.none", remedy("recordings_are_in"), file=str(path))


def folder(path: Path) -> Reason:
    path.mkdir()
    (path / "a.mcap").write_bytes(b"")
    return because("recording.folder", remedy("as_recording", file=str(path / "a.mcap")), file=str(path))


def folder_of_ros2(path: Path) -> Reason:
    path.mkdir()
    (path / "metadata.yaml").write_text("")
    return because("recording.rosbag2", ROS2, file=str(path))


@pytest.mark.parametrize("cause", [empty, not_one, rosbag, absent, folder, folder_of_ros2])
def test_a_file_that_is_no_recording_says_what_it_is(cause: Callable[[Path], Reason], tmp_path: Path) -> None:
    path = tmp_path / "file"
    expected = cause(path)
    with pytest.raises(BadRecording) as bad:
        RecordingReader(path)
    assert bad.value.reason == expected


def test_a_recording_that_ends_in_a_record_says_so(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(MAGIC + b"\x01\xff")
    reader = RecordingReader(path)
    assert list(reader.records()) == []
    assert reader.damage.problem is not None
    assert reader.damage.problem.code == "recording.ends.in_record"


def test_a_recording_of_another_program_says_which_reads_it() -> None:
    file = Path("a.mcap")
    own = reason_of(file, {"own"}, ["a", "b", "c", "d"])
    values = {"file": "a.mcap", "encoding": "own", "topics": "a, b, c ..."}
    assert own == because("recording.foreign.unknown", remedy("show_in_foxglove"), **values)
    both = reason_of(file, {"cdr", "own"}, ["a"])
    assert both == because("recording.foreign.more", ROS2, file="a.mcap", kind="cdr", others=("own",), topics="a")
    assert kind_of(Path("nowhere")) is None


def test_a_pattern_without_a_topic_names_those_that_there_are() -> None:
    with pytest.raises(NothingToExport) as nothing:
        chosen(["joint_states", "scene"], ["device/*"])
    there = remedy("there_is", names="joint_states, scene")
    assert nothing.value.reason == because("recording.no_topic", there, pattern="device/*")


def test_a_shadow_has_a_name_of_its_own() -> None:
    with pytest.raises(CommandError) as unusable:
        require_name("a b")
    assert unusable.value.reason == because("cli.play.name", name="a b")
    assert refused("rm1").reason == because("cli.play.living", name="rm1")
