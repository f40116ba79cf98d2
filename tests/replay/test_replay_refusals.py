"""Recordings that cannot be replayed are refused by one sentence with the cause and the remedy."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from mcap.records import Channel, Metadata, Schema

from gemelo.libraries.recordings.reader import BadRecording
from gemelo.tools.replay.main import replay, text_of
from gemelo.tools.replay.recorded import NotReplayable
from tests.replay.conftest import RECORDINGS, Messages


def test_a_gap_in_the_inputs(changed):
    file = changed("state_publisher", Messages("joint_states", lambda _, number: number not in (100, 101, 102)))
    with pytest.raises(NotReplayable, match=r"3 messages of joint_states are missing between .* s and .* s"):
        replay(file, "state_publisher")


def test_the_input_of_an_output_that_the_recorder_missed(changed):
    """LATEST topics have no numbers of their own: what is missing shows where its output is."""

    def alter(state, number):
        if number == 100:
            state["stamp"] += 1

    with pytest.raises(NotReplayable, match=r"joint state of stamp \d+ ns is missing"):
        replay(changed("state_publisher", Messages("joint_states", alter)), "state_publisher")


def test_the_inputs_of_a_plan_that_are_missing(changed):
    def alter(inputs, number):
        inputs["number"] += number > 2

    with pytest.raises(NotReplayable, match=r"plan/inputs of the plan at .* s is missing \(number 4\)"):
        replay(changed("planner", Messages("plan/inputs", alter)), "planner")


def test_a_file_that_was_cut_off(tmp_path):
    whole = (RECORDINGS / "state_publisher.mcap").read_bytes()
    (cut := tmp_path / "cut.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(NotReplayable, match="`gemelo bag repair"):
        replay(cut, "state_publisher")


def test_a_file_that_is_no_recording(tmp_path):
    (text := tmp_path / "text.mcap").write_text("nothing")
    with pytest.raises(BadRecording, match="is no MCAP recording"):
        replay(text, "planner")


def test_a_recording_without_the_inputs(changed):
    file = changed("state_publisher", Messages("joint_states", lambda *_: False))
    with pytest.raises(NotReplayable, match="no message of joint_states, which stepper_gateway writes"):
        replay(file, "state_publisher")


def test_a_recording_of_another_service():
    with pytest.raises(NotReplayable, match="there is no message of"):
        replay(RECORDINGS / "state_publisher.mcap", "planner")


def test_the_scene_of_a_plan_that_is_missing(changed):
    def alter(scene, number):
        scene["epoch"] += 1 if scene["version"] else 0

    with pytest.raises(NotReplayable, match=r"version \d+ of the scene, in which the plan at .* s was made"):
        replay(changed("planner", Messages("scene", alter)), "planner")


def of_robot(**files):
    def change(record):
        if isinstance(record, Metadata) and record.name == "robot":
            record.metadata.update({name: alter(record.metadata[name]) for name, alter in files.items()})
        return record

    return change


def test_another_version_of_the_robots_file(changed):
    file = changed("planner", of_robot(robot_toml=lambda text: text.replace("3", "4", 1)))
    with pytest.raises(
        NotReplayable, match=r"its robot.toml is another than .*robot.toml, first in line \d+: re(play|cord)"
    ):
        replay(file, "planner")


def test_another_robot(changed):
    with pytest.raises(NotReplayable, match=r'it is of the robot "other", and .* is "rm1": name the folder'):
        replay(changed("planner", of_robot(robot=lambda _: "other")), "planner")


def test_a_robot_whose_folder_is_not_here(changed):
    def change(record):
        if isinstance(record, Metadata) and record.name == "deployment":
            record.metadata["json"] = '{"robot": "urdf/nobody"}'
        return record

    with pytest.raises(NotReplayable, match='"urdf/nobody", and there is no such folder here: name it with --robot'):
        replay(changed("planner", change), "planner")


def test_a_recording_without_the_robots_files(changed):
    drop = lambda record: None if isinstance(record, Metadata) and record.name == "robot" else record  # noqa: E731
    with pytest.raises(NotReplayable, match="record the topic `description` too"):
        replay(changed("state_publisher", drop), "state_publisher")


def test_a_message_that_had_other_fields(changed):
    def change(record):
        if isinstance(record, Schema) and record.name == "JointState":
            record.data = record.data.replace(b'"effort":', b'"torque":', 1)
        return record

    with pytest.raises(NotReplayable, match=r"JointState of joint_states has other fields.*new effort; no longer torq"):
        replay(changed("state_publisher", change), "state_publisher")


def test_a_message_that_has_got_a_field_since_is_read_with_its_default(changed):
    def change(record):
        if isinstance(record, Schema) and record.name == "JointState":
            schema = json.loads(record.data)
            del schema["properties"]["effort"]
            record.data = json.dumps(schema).encode()
        return record

    replayed = replay(changed("state_publisher", change), "state_publisher")
    assert replayed.added == {"joint_states": ["effort"]}
    assert "joint_states is older than its fields effort: read with their defaults" in text_of(replayed)


@pytest.mark.parametrize(
    ("service", "topic", "place"),
    [("state_publisher", "joint_states", ()), ("planner", "plan/inputs", ("present",)), ("planner", "scene", ())],
)
def test_a_message_without_a_field_that_its_own_schema_has_is_not_whole(changed, service, topic, place):
    """It is not older than that field, so its default is a guess."""
    lost = []

    def alter(content, number):
        if number == 1:
            for key in place:
                content = content[key]
            lost.append(list(content)[-1])
            del content[lost[0]]

    with pytest.raises(NotReplayable) as refused:
        replay(changed(service, Messages(topic, alter)), service)
    assert f"message 1 of {topic} has no {lost[0]}, which its own schema has" in str(refused.value)


def test_a_recording_of_today_has_no_added_fields():
    replayed = replay(RECORDINGS / "state_publisher.mcap", "state_publisher")
    assert replayed.added == {}
    assert "older" not in text_of(replayed)


def test_nothing_but_inputs(changed):
    def change(record):
        if isinstance(record, Channel) and record.topic == "frames":
            record.topic = "others"
        return record

    with pytest.raises(NotReplayable, match="there is no message of frames"):
        replay(changed("state_publisher", change), "state_publisher")


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        ((str(RECORDINGS / "state_publisher.mcap"), "state_publisher"), 0, "no difference"),
        ((str(RECORDINGS / "state_publisher.mcap"), "planner"), 2, "there is no message of"),
        (("nowhere.mcap", "planner"), 2, 'there is no file "nowhere.mcap"'),
        ((str(RECORDINGS / "planner.mcap"), "logger"), 2, "planner"),
    ],
)
def test_the_command_says_so_in_words_and_by_its_exit_code(arguments, code, said):
    command = [sys.executable, "-m", "gemelo.tools.cli.main", "replay", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    assert said in done.stdout + done.stderr


def test_the_command_ends_with_1_at_a_difference(changed):
    def alter(state, number):
        if number == 200:
            state["position"][0] += 1e-3

    file = changed("state_publisher", Messages("joint_states", alter))
    command = [sys.executable, "-m", "gemelo.tools.cli.main", "replay", str(file), "state_publisher", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 1, done.stderr
    assert '"topic":"frames"' in done.stdout
