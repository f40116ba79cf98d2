"""Recordings of other programs: `bag export`, `bag play` and `replay` say what they are and what to do with them."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.writer import CompressionType, Writer

from gemelo.libraries.recordings.reader import BadRecording
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from gemelo.tools.replay.main import CANNOT
from gemelo.tools.replay.main import main as replay
from gemelo.tools.replay.recorded import Recorded
from tests.runtime.support import free_port

ROS2 = "is a recording of ROS 2 (CDR messages)"


def written(
    path: Path, *encodings: str, profile: str = "", compression: CompressionType = CompressionType.ZSTD
) -> Path:
    """An MCAP of two messages of each encoding, as another program writes it."""
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start(profile=profile, library="another")
        for number, encoding in enumerate(encodings):
            schema = writer.register_schema(name=f"a/msg/{number}", encoding="ros2msg", data=b"float64 x\n")
            channel = writer.register_channel(topic=f"/{encoding}", message_encoding=encoding, schema_id=schema)
            for at in range(2):
                writer.add_message(channel, log_time=at + 1, publish_time=at + 1, data=b"\0\1\0\0" + bytes(8))
        writer.finish()
    return path


@pytest.fixture(autouse=True)
def nothing_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(free_port()))


@pytest.mark.parametrize(
    ("encodings", "profile", "said"),
    [
        (("cdr",), "ros2", f"{ROS2}, of /cdr, and none of gemelo: `ros2 bag play` plays it"),
        (("cdr",), "", ROS2),
        (("ros1",), "ros1", "is a recording of ROS 1, of /ros1"),
        (("json",), "", "is a recording of another program, in JSON, of /json"),
        (("protobuf",), "", "is a recording of another program, in protobuf, of /protobuf"),
        (("json", "protobuf"), "", "in JSON, with protobuf messages too, of /json, /protobuf"),
        (("cbor",), "x", "in CBOR"),
        (("flatbuffer",), "", "in FlatBuffers"),
        (("own",), "", 'its messages "own"'),
        (("",), "", 'its messages ""'),
    ],
)
@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_what_it_is_and_what_to_do_is_said_by_all_three(tmp_path, capsys, encodings, profile, said, compression):
    file = written(tmp_path / "theirs.mcap", *encodings, profile=profile, compression=compression)
    for command in (["bag", "export", str(file), "-o", str(tmp_path / "out")], ["bag", "play", str(file)]):
        assert run(command) is ExitCode.USAGE
        error = capsys.readouterr().err
        assert said in error
        assert f"`gemelo bag info {file}` lists it" in error
        assert len(error.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    with pytest.raises(BadRecording) as refused:
        Recorded(file, ())
    assert said in str(refused.value)


def test_replay_ends_with_the_sentence(tmp_path, capsys, monkeypatch):
    file = written(tmp_path / "theirs.mcap", "cdr", profile="ros2")
    monkeypatch.setattr("sys.argv", ["replay", str(file), "planner"])
    with pytest.raises(SystemExit) as ended:
        replay()
    assert ended.value.code == CANNOT
    assert ROS2 in capsys.readouterr().err


def test_info_lists_what_is_in_it(tmp_path, capsys):
    assert run(["bag", "info", str(written(tmp_path / "theirs.mcap", "cdr", profile="ros2"))]) is ExitCode.OK
    assert "a/msg/0" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"#ROSBAG V2.0\n", "is a recording of ROS 1 (rosbag): `rosbags-convert`"),
        (b"SQLite format 3\0", "is a recording of ROS 2 in SQLite (rosbag2): `ros2 bag convert`"),
    ],
)
def test_a_file_of_another_form_is_named(tmp_path, capsys, content, said):
    (tmp_path / "theirs").write_bytes(content)
    for command in ("export", "play", "info"):
        assert run(["bag", command, str(tmp_path / "theirs")]) is ExitCode.USAGE
        assert said in capsys.readouterr().err


def test_the_folder_of_rosbag2_is_named_with_its_files(tmp_path, capsys):
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    written(tmp_path / "bag_0.mcap", "cdr", profile="ros2")
    assert run(["bag", "play", str(tmp_path)]) is ExitCode.USAGE
    assert "is the folder of a ROS 2 recording (rosbag2) with bag_0.mcap" in capsys.readouterr().err
