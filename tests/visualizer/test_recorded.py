"""A recording in the twin's own view; a black box opens at its incident, with its story."""

from __future__ import annotations

import base64
import subprocess
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.incidents import Happening, Incident, IncidentKind, incident_metadata
from gemelo.libraries.recordings.mcap_file import ROBOT, McapFile
from gemelo.libraries.recordings.reader import BadRecording
from gemelo.libraries.recordings.view_layout import ViewLayout, layout_metadata
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.message import Message
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DESCRIPTION, DEVICE_STATE, JOINT_COMMANDS, JOINT_STATES, STEP_ERRORS, Delivery, Topic
from gemelo.services.state_publisher.main import describe
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.services.visualizer.recorded import story_text, write_view

SECOND = 1_000_000_000
START = 1_795_000_000 * SECOND
ROOT = Path(__file__).parents[2]
INCIDENT = Incident(
    stamp=START + SECOND, kind=IncidentKind.FAULT, sentence="it stopped", margins=("brazo_joint at rest",),
    story=(Happening(at=-0.5, text="a | b"),),
)  # fmt: skip


class Picture(Message, frozen=True, kw_only=True):
    data: bytes = b""


def recording(path: Path, *entries: Entry, incident: Incident | None = None) -> Path:
    file = McapFile(path, incident_metadata(incident) if incident else {})
    file.write(entries)
    file.close()
    return path


def moving(robot: str) -> list[Entry]:
    arm = load_arm(ROOT / f"urdf/{robot}")
    names = tuple(joint.name for joint in arm.joints)
    found = [Entry(DESCRIPTION, describe(arm), START)]
    for index in range(100):
        at = START + index * SECOND // 50
        position = (0.001 * index,) * len(names)
        state = JointState(stamp=at, name=names, position=position, velocity=(0.05,) * len(names))
        found += [
            Entry(JOINT_STATES, state, at),
            Entry(JOINT_COMMANDS, state, at),
            Entry(STEP_ERRORS, StepErrors(stamp=at, name=names, error=(0.2,) * len(names)), at),
            Entry(DEVICE_STATE, DeviceState(stamp=at, mode=DeviceMode.RUN), at),
        ]
    return found


def printed(rrd: Path, detail: str = "-vv") -> str:
    return subprocess.run(
        [rerun_binary(), "rrd", "print", detail, rrd], capture_output=True, text=True, check=True
    ).stdout


def test_the_layout_that_the_file_keeps_is_the_one_that_is_shown(tmp_path):
    path = tmp_path / "box.mcap"
    layout = ViewLayout(window=7.5, trail=3.25, cameras=("overhead",))
    file = McapFile(path, {**incident_metadata(INCIDENT), **layout_metadata(layout)})
    file.write(moving("rm1"))
    file.close()
    write_view(path, tmp_path / "view.rrd", tmp_path / "shadow")
    text = printed(tmp_path / "view.rrd", "-vvv")
    for shown in ("-7500000000", "-3250000000", entities.camera_picture("overhead")):
        assert shown in text
    write_view(recording(tmp_path / "bag.mcap", *moving("rm1")), tmp_path / "usual.rrd", tmp_path / "shadow")
    text = printed(tmp_path / "usual.rrd", "-vvv")
    assert "-7500000000" not in text
    assert "-20000000000" in text


@pytest.mark.parametrize("robot", ["rm1", "parol6"])
def test_everything_that_the_live_view_shows_is_drawn_and_the_story_is_beside_it(tmp_path, robot):
    file = recording(tmp_path / "box.mcap", *moving(robot), incident=INCIDENT)
    assert write_view(file, tmp_path / "view.rrd", tmp_path / "shadow") == INCIDENT
    text = printed(tmp_path / "view.rrd")
    joint = load_arm(ROOT / f"urdf/{robot}").joints[0].name
    for entity in (entities.executed(joint), entities.error(joint), entities.MODE, entities.TRAIL, entities.STORY):
        assert f"/{entity}" in text
    assert "TimePanelBlueprint:time_selection" in text


def test_a_plain_recording_opens_without_a_story(tmp_path):
    file = recording(tmp_path / "bag.mcap", *moving("rm1"))
    assert write_view(file, tmp_path / "view.rrd", tmp_path / "shadow") is None
    text = printed(tmp_path / "view.rrd")
    assert f"/{entities.STORY}" not in text
    assert "time_selection" not in text


def test_images_of_cameras_are_shown(tmp_path):
    topic = Topic("foxglove/camera/overhead/image", Picture, Delivery.LATEST, None, True, "logger", "")
    jpeg = base64.b64decode("/9j/4AAQSkZJRgABAQAAAQABAAD/2Q==")
    entry = Entry(topic, Picture(data=jpeg), START + SECOND // 2)
    file = recording(tmp_path / "bag.mcap", *moving("rm1"), entry)
    write_view(file, tmp_path / "view.rrd", tmp_path / "shadow")
    assert f"/{entities.camera_picture('overhead')}" in printed(tmp_path / "view.rrd")


def test_the_story_is_a_table_that_no_text_breaks():
    assert story_text(INCIDENT).splitlines() == [
        "### it stopped", "", "- brazo_joint at rest", "", "| | |", "|--:|:--|", "| -0.50 s | a \\| b |",
    ]  # fmt: skip


def test_the_story_beside_the_view_is_in_its_language(tmp_path):
    why = because("incident.at", because("incident.emergency_stop"), time="2026-11-18 11:06:43.500 UTC")
    incident = replace(INCIDENT, sentence=str(why), why=why, margins=(), story=())
    file = recording(tmp_path / "box.mcap", *moving("rm1"), incident=incident)
    write_view(file, tmp_path / "view.rrd", tmp_path / "shadow", "es")
    text = printed(tmp_path / "view.rrd", "-vvv")
    assert "parada de emergencia" in text
    assert "emergency stop" not in text


def test_a_recording_of_no_robot_is_said(tmp_path):
    file = recording(tmp_path / "bag.mcap")
    with pytest.raises(BadRecording, match="recorded without state_publisher"):
        write_view(file, tmp_path / "view.rrd", tmp_path / "shadow")
    file = McapFile(
        tmp_path / "wrong.mcap", {ROBOT: {"robot": "rm1", "robot_toml": "name = [", "urdf": "", "srdf": ""}}
    )
    file.close()
    with pytest.raises(BadRecording, match=r"robot\.toml cannot be read"):
        write_view(file.path, tmp_path / "view.rrd", tmp_path / "shadow")


@pytest.mark.parametrize("change", ["", "<link"])
def test_a_recording_whose_robot_cannot_be_drawn_is_said_with_its_code(tmp_path, change):
    robot = describe(load_arm(ROOT / "urdf/rm1"))
    files = {"robot": "rm1", "robot_toml": robot.robot_toml, "urdf": robot.urdf, "srdf": robot.srdf}
    file = McapFile(tmp_path / "box.mcap", {ROBOT: files})
    if change:
        file.write([Entry(DESCRIPTION, replace(robot, urdf=robot.urdf.replace(change, "<other")), START)])
    file.close()
    with pytest.raises(BadRecording) as refused:
        write_view(tmp_path / "box.mcap", tmp_path / "view.rrd", tmp_path / "shadow")
    code = "recording.robot.not_drawn" if change else "recording.robot.no_description"
    assert (refused.value.reason.code, refused.value.reason.values) == (code, {"file": str(tmp_path / "box.mcap")})
