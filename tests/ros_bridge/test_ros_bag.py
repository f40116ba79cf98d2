"""A recording as a bag of ROS 2: others read the same numbers at the same times."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.ros2.types import ros_type, store
from gemelo.schemas.device import DeviceState
from gemelo.schemas.frames import FrameTransform, FrameTransforms
from gemelo.schemas.joints import JointState
from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.schemas.topics import DESCRIPTION, DEVICE_STATE, FRAMES, JOINT_STATES, LOG, STATIC_FRAMES
from gemelo.services.state_publisher.main import describe
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run

START = 1_795_000_000_000_000_000
STATES = [JointState(stamp=START + k, name=("a", "b"), position=(0.01 * k, -1.0)) for k in range(25)]
FRAME = FrameTransform(stamp=START, parent="base", child="tool")


@pytest.fixture
def recording(tmp_path: Path, rm1: ArmDescription) -> Path:
    file = McapFile(tmp_path / "bag.mcap", {})
    file.write([Entry(DESCRIPTION, describe(rm1), START)])
    file.write([Entry(STATIC_FRAMES, FrameTransforms(transforms=(FRAME,)), START)])
    file.write([Entry(FRAMES, FrameTransforms(transforms=(FRAME, FRAME)), START)])
    file.write([Entry(LOG, LogRecord(stamp=START, node="planner", level=LogLevel.WARNING, text="late"), START)])
    file.write([Entry(DEVICE_STATE, DeviceState(stamp=START), START)])
    file.write(Entry(JOINT_STATES, state, START + k * 20_000_000) for k, state in enumerate(STATES))
    file.close()
    return file.path


def test_a_bag_has_the_messages_of_ros_at_the_times_of_the_recording(
    recording: Path, tmp_path: Path, rm1: ArmDescription, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bag", "export", str(recording), "--ros2", str(tmp_path / "ros")]) is ExitCode.OK
    assert "joint_states" in capsys.readouterr().out
    (file,) = (tmp_path / "ros").glob("*.mcap")
    with file.open("rb") as opened:
        reader = make_reader(opened, decoder_factories=[DecoderFactory()])
        read = [(channel.topic, at.log_time, each) for _, channel, at, each in reader.iter_decoded_messages()]
    states = [(time, each) for topic, time, each in read if topic == "/joint_states"]
    assert [tuple(each.position) for _, each in states] == [each.position for each in STATES]
    assert [time for time, _ in states] == [START + k * 20_000_000 for k in range(25)]
    assert states[3][1].header.stamp.nanosec == (START + 3) % 1_000_000_000
    texts = {topic: each for topic, _, each in read}
    assert texts["/robot_description"].data == describe(rm1).urdf
    assert texts["/robot_description_semantic"].data == describe(rm1).srdf
    assert [each.child_frame_id for each in texts["/tf"].transforms] == ["tool", "tool"]
    assert (texts["/rosout"].level, texts["/rosout"].msg) == (30, "late")
    assert not any("device" in topic for topic in texts)


def test_the_bag_s_own_file_names_types_hashes_and_what_is_latched(recording: Path, tmp_path: Path) -> None:
    assert run(["bag", "export", str(recording), "--ros2", str(tmp_path / "ros")]) is ExitCode.OK
    with Reader(tmp_path / "ros") as reader:
        found = {each.topic: each for each in reader.connections}
        assert {topic: each.digest for topic, each in found.items()} == {
            topic: ros_type(each.msgtype).hash for topic, each in found.items()
        }
        latched = {
            topic for topic, each in found.items()
            if each.ext.offered_qos_profiles[0].durability is QosDurability.TRANSIENT_LOCAL  # type: ignore[union-attr]
        }  # fmt: skip
        assert latched == {"/tf_static", "/robot_description", "/robot_description_semantic"}
        (_, _, raw), *_ = reader.messages([found["/tf"]])
        message = store().deserialize_cdr(raw, "tf2_msgs/msg/TFMessage")
        assert message.transforms[0].child_frame_id == "tool"  # type: ignore[attr-defined]


def test_chosen_topics_alone_and_none_of_ros_is_one_sentence(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bag", "export", str(recording), "frames", "--ros2", str(tmp_path / "tf")]) is ExitCode.OK
    with Reader(tmp_path / "tf") as reader:
        assert set(reader.topics) == {"/tf"}
    capsys.readouterr()
    assert run(["bag", "export", str(recording), "device/*", "--ros2", str(tmp_path / "no")]) is ExitCode.USAGE
    said = capsys.readouterr().err
    assert "joint_states" in said
    assert not (tmp_path / "no").exists()


def test_a_folder_that_is_there_is_left_as_it_is(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ros").mkdir()
    assert run(["bag", "export", str(recording), "--ros2", str(tmp_path / "ros")]) is not ExitCode.OK
    assert str(tmp_path / "ros") in capsys.readouterr().err
    assert list((tmp_path / "ros").iterdir()) == []
