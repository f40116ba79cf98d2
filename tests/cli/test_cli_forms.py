"""Commands that watch the bus, as a program reads them: each on a real router, as JSON and as CSV, once and n times."""

from __future__ import annotations

import csv
import io
import json
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Annotated

import msgspec
import pytest
from msgspec import Meta

from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import ACTIONS, FRAMES, JOINT_STATES, REQUESTS, STATIC_FRAMES, TOPICS
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.runtime.support import spinning

LIFT = Transform(translation=(0.1, 0.0, 0.2))
ON_TOP = Transform(translation=(0.0, 0.05, 0.0))
SVG = "{http://www.w3.org/2000/svg}"


class Knobs(msgspec.Struct, frozen=True, kw_only=True):
    gain: Annotated[float, Meta(ge=0.0, le=2.0, description="of the thing")] = 1.0


@pytest.fixture
def talking(router) -> Iterator[None]:
    """A node that says where joints and frames are, fifty times a second, and logs it."""
    with Node("state_publisher", robot="rm1", log_level="error") as node:
        node.log.setLevel("INFO")
        node.log.handlers[0].setLevel("ERROR")  # on the bus, and not on stderr
        node.parameters(Knobs)
        states, frames, fixed = node.publisher(JOINT_STATES), node.publisher(FRAMES), node.publisher(STATIC_FRAMES)
        hand = FrameTransform(parent="arm", child="hand <1>", transform=ON_TOP)

        def step(now: int) -> None:
            states.put(JointState(stamp=now, name=("a", "b"), position=(0.5, -2.0)))
            arm = FrameTransform(stamp=now, parent="base", child="arm", transform=LIFT)
            frames.put(FrameTransforms(transforms=(arm,)))
            node.log.info("step")

        fixed.put(FrameTransforms(transforms=(hand,)))
        with spinning(node, step):
            yield


def said(capsys, *words: str) -> str:
    assert run(list(words)) is ExitCode.OK
    return capsys.readouterr().out


def from_json(capsys, *words: str):
    """The only line that the command prints."""
    (line,) = said(capsys, *words, "--json").splitlines()
    return json.loads(line)


def from_csv(capsys, *words: str) -> tuple[list[str], list[list[str]]]:
    """Heading and rows."""
    heading, *rows = csv.reader(io.StringIO(said(capsys, *words, "--csv")))
    return heading, rows


def test_the_tables_are_json(router, capsys):
    topics = {row["topic"]: row for row in from_json(capsys, "topic", "list")}
    assert set(topics) == {topic.key for topic in TOPICS}
    assert topics["joint_states"]["rate_hz"] == 50.0
    assert [row["request"] for row in from_json(capsys, "request", "list")] == [each.key for each in REQUESTS]
    assert [row["action"] for row in from_json(capsys, "action", "list")] == [each.key for each in ACTIONS]
    assert from_json(capsys, "topic", "info", "joint_states")["fields"]["position"] == "Vector"
    assert "fields" in from_json(capsys, "action", "info", "follow_joint_trajectory")["result"]


@pytest.mark.parametrize(
    ("word", "field", "least", "most"),
    [("hz", "rate", 20.0, 100.0), ("bw", "bytes_per_second", 500.0, 50_000.0), ("delay", "delay_mean", 0.0, 1.0)],
)
def test_rates_sizes_and_delays_are_numbers(talking, capsys, word, field, least, most):
    report = from_json(capsys, "topic", word, "joint_states", "--once")
    assert least <= report[field] <= most
    assert report["window"] > 5
    heading, rows = from_csv(capsys, "topic", word, "joint_states", "-n", "2")
    assert heading == list(report)
    assert len(rows) == 2
    assert least <= float(rows[1][heading.index(field)]) <= most


def test_the_writer_and_the_readers_of_a_topic_are_json(talking, capsys):
    told = from_json(capsys, "topic", "info", "joint_states")
    assert told["read_by"] == {}
    assert 25.0 < told["written_by"]["state_publisher"]["rate_hz"] < 100.0
    assert "position" in told["fields"]


def test_poses_are_json_csv_and_single_fields(talking, capsys):
    pose = from_json(capsys, "tf", "echo", "base", "hand <1>", "--once")
    assert pose["transform"]["translation"] == pytest.approx([0.1, 0.05, 0.2])
    heading, rows = from_csv(capsys, "tf", "echo", "base", "hand <1>", "-n", "2", "-r", "50")
    assert [float(row[heading.index("transform.translation[2]")]) for row in rows] == pytest.approx([0.2, 0.2])
    z = from_json(capsys, "tf", "echo", "base", "hand <1>", "--once", "--field", "transform.translation[2]")
    assert z == pytest.approx(0.2)
    assert run(["tf", "echo", "base", "arm", "--field", "transfrom"]) is ExitCode.USAGE
    assert 'did you mean "transform"' in capsys.readouterr().err


def test_the_tree_is_json_and_an_svg_with_every_frame_in_it(talking, capsys, tmp_path):
    frames = from_json(capsys, "tf", "tree")
    assert frames == [
        {"frame": "base", "parent": None, "fixed": False},
        {"frame": "arm", "parent": "base", "fixed": False},
        {"frame": "hand <1>", "parent": "arm", "fixed": True},
    ]
    file = tmp_path / "frames.svg"
    said(capsys, "tf", "tree", "--svg", str(file))
    picture = ET.fromstring(file.read_text())
    assert picture.tag == f"{SVG}svg"
    assert [text.text for text in picture.iter(f"{SVG}text")] == [each["frame"] for each in frames]
    wide, high = float(picture.get("width", "0")), float(picture.get("height", "0"))
    boxes = list(picture.iter(f"{SVG}rect"))
    assert len(boxes) == 3
    for box in boxes:
        x, y, width, height = (float(box.get(key, "nan")) for key in ("x", "y", "width", "height"))
        assert 0.0 <= x < x + width <= wide
        assert 0.0 <= y < y + height <= high
    assert len(list(picture.iter(f"{SVG}path"))) == 2  # one to each frame that hangs on another
    assert run(["tf", "tree", "--svg", str(tmp_path / "nowhere" / "frames.svg")]) is ExitCode.FAILED
    assert "frames.svg cannot be written" in capsys.readouterr().err


def test_the_rates_of_frames_are_rows(talking, capsys):
    (frame,) = from_json(capsys, "tf", "monitor", "--once")
    assert frame["frame"] == "arm"
    assert 20.0 < frame["rate"] < 100.0
    heading, rows = from_csv(capsys, "tf", "monitor", "-n", "2")
    assert heading == ["frame", "rate", "delay_mean", "delay_max"]
    assert [row[0] for row in rows] == ["arm", "arm"]


def test_the_figures_of_nodes_are_rows(talking, capsys):
    report = from_json(capsys, "top", "--once")
    (node,) = report["nodes"]
    assert node["node"] == "state_publisher"
    assert 25.0 < node["loop_rate"] < 100.0
    assert node["memory"] > 1e7
    assert report["slow_topics"] == []
    heading, rows = from_csv(capsys, "top", "--once")
    assert heading == list(node)
    assert [row[0] for row in rows] == ["state_publisher"]


def test_nodes_parameters_and_records_of_the_log_are_json(talking, capsys):
    (node,) = from_json(capsys, "node", "list")
    assert node["node"] == "state_publisher"
    assert "joint_states" in node["info"]["publishes"]
    assert from_json(capsys, "node", "info", "state_publisher")["pid"] == os.getpid()
    (knob,) = from_json(capsys, "param", "list")
    assert (knob["node"], knob["name"], knob["value"], knob["maximum"]) == ("state_publisher", "gain", 1.0, 2.0)
    assert from_json(capsys, "param", "get", "state_publisher", "gain") == 1.0
    assert from_json(capsys, "param", "describe", "state_publisher", "gain")["description"] == "of the thing"
    assert from_json(capsys, "log", "--once")["text"] == "step"
    heading, rows = from_csv(capsys, "log", "-n", "3")
    assert [row[heading.index("text")] for row in rows] == ["step"] * 3
