"""Commands that show the bus: fields of messages, rates, sizes and delays, frames, interfaces, parameters as files."""

from __future__ import annotations

import csv
import io
import json
import math
import os
import re
import socket
import threading
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Annotated

import msgspec
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from msgspec import Meta

import gemelo
from gemelo.libraries.arm.frames.transforms import from_rpy, to_rpy
from gemelo.libraries.recordings.table import exchanges_of
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Publisher
from gemelo.schemas.device import DeviceStopRequest, StopKind
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message, encode
from gemelo.schemas.system import NodeStatistics, TopicStatistics
from gemelo.schemas.topics import (
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    FRAMES,
    JOINT_STATES,
    LOG,
    STATIC_FRAMES,
    STATISTICS,
    Delivery,
    Topic,
)
from gemelo.tools.cli.bus import (
    action_watch,
    interface,
    living_topics,
    node_parameters,
    request,
    topic,
    topic_ends,
    topic_rates,
)
from gemelo.tools.cli.bus.field_path import FieldPath, leaves
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.forms import csv_lines, json_line, yaml_document
from gemelo.tools.cli.common.session import CommandSession
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch import tf, top
from tests.runtime.support import hear, spinning

WHOLE = FieldPath(FrameTransform, "")
STATE = JointState(stamp=5, name=("a", "b"), position=(0.5, -2.0))


@pytest.fixture
def stack(gateway):
    return gateway


def moving(now: int) -> FrameTransforms:
    arm = Transform(translation=(0.1, 0.0, 0.2), rotation=from_rpy(0.0, 0.0, math.pi / 2))
    return FrameTransforms(transforms=(FrameTransform(stamp=now, parent="base", child="arm", transform=arm),))


@pytest.fixture
def frames(deployment, network) -> Iterator[None]:
    """A base with an arm that moves, and a hand fixed to it."""
    with Node("state_publisher", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        publisher = node.publisher(FRAMES)
        hand = FrameTransform(parent="arm", child="hand <1>", transform=Transform(translation=(0.0, 0.05, 0.0)))
        node.publisher(STATIC_FRAMES).put(FrameTransforms(transforms=(hand,)))
        with spinning(node, lambda now: publisher.put(moving(now))):
            yield


class Inner(Message, frozen=True, kw_only=True):
    depth: float = 0.0  # [m]


class Sonar(Message, frozen=True, kw_only=True):
    """A message that `schemas` does not have."""

    stamp: int = 0
    echo: Inner = Inner()
    beams: tuple[float, ...] = ()


SONAR = Topic("sonar", Sonar, Delivery.LATEST, 20.0, False, "diver", "what is below")


@pytest.fixture
def diver(deployment, network) -> Iterator[None]:
    """A user's own node, with a topic of his own."""
    with Node("diver", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        publisher = node.publisher(SONAR)
        with spinning(
            node, lambda now: publisher.put(Sonar(stamp=now, echo=Inner(depth=1.5), beams=(0.1, 0.2))), rate=20.0
        ):
            yield


def test_the_topic_of_a_user_s_node_is_found_with_its_fields(session, diver):
    (found,) = living_topics.other_topics(session)
    assert (found.key, found.rate, found.delivery) == ("sonar", 20.0, Delivery.LATEST)
    assert "Inner" in topic.information(found)
    assert "sonar" in topic.listing([found])


def test_the_topic_of_a_user_s_node_is_echoed(session, diver, capsys):
    found = living_topics.topic_on(session, "sonar")
    assert topic.echo(session, found, FieldPath(found.message, "echo.depth"), json_line, 2) is ExitCode.OK
    assert capsys.readouterr().out.splitlines() == ["1.5", "1.5"]


def test_the_topic_of_a_user_s_node_is_echoed_whole(session, diver, capsys):
    found = living_topics.topic_on(session, "sonar")
    assert topic.echo(session, found, FieldPath(found.message, ""), yaml_document, 1) is ExitCode.OK
    assert yaml.safe_load(capsys.readouterr().out.removesuffix("---\n"))["echo"] == {"depth": 1.5}


def test_the_rate_of_a_user_s_topic_is_measured(session, diver, capsys):
    assert topic_rates.hz(session, living_topics.topic_on(session, "sonar"), 1000, 1) is ExitCode.OK
    assert 10.0 < float(capsys.readouterr().out.split()[2]) < 40.0


def test_the_bandwidth_and_the_delay_of_a_user_s_topic_are_measured(session, diver, deployment, network):
    reports: list[object] = []

    def keep(report: object) -> str:
        reports.append(report)
        return ""

    found = living_topics.topic_on(session, "sonar")
    assert topic_rates.bandwidth(session, found, 1000, 1, keep) is ExitCode.OK
    with Node("cli-2", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        assert topic_rates.delay(session._replace(node=node), found, 1000, 1, keep) is ExitCode.OK
    bandwidth, delay = reports
    assert isinstance(bandwidth, topic_rates.Bandwidth)
    size = len(encode(Sonar(stamp=2**60, echo=Inner(depth=1.5), beams=(0.1, 0.2))))
    assert bandwidth.size_min == bandwidth.size_max == size
    assert 10.0 * size < bandwidth.bytes_per_second < 40.0 * size
    assert isinstance(delay, topic_rates.Delay)
    assert 0.0 <= delay.delay_min <= delay.delay_mean <= delay.delay_max < 1.0


def test_a_topic_of_nobody_is_answered_with_the_nearest_of_all(session, diver):
    with pytest.raises(CommandError, match=r'no topic "sona": did you mean "sonar"'):
        living_topics.topic_on(session, "sona")


def test_who_writes_and_reads_a_topic_is_named_with_rates(session, stack, deployment, network):
    with Node("reader", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.subscribe(JOINT_STATES, lambda state: None, batch=0.0)  # none is overrun by a newer one
        with spinning(node):
            told = topic_ends.ends(session, JOINT_STATES)
    (writer,) = told.written_by.items()
    assert writer[0] == "stepper_gateway"
    assert writer[1].process == f"{os.getpid()} on {socket.gethostname()}"
    assert 25.0 < writer[1].rate_hz < 100.0
    reader = told.read_by["reader"]
    assert reader.rate_hz is not None
    assert 25.0 < reader.rate_hz < 100.0
    assert reader.received is not None
    assert reader.received > 50
    assert (reader.lost, reader.bad) == (0, 0)


def test_a_node_that_hangs_does_not_keep_the_others_from_being_named(session, diver, deployment, network):
    with Node("hanging", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.subscribe(SONAR, lambda message: None)  # and nobody lets it spin
        told = topic_ends.ends(session, living_topics.topic_on(session, "sonar"))
    assert list(told.written_by) == ["diver"]
    assert told.read_by == {}


def test_what_a_reader_has_lost_is_said(session, diver, deployment, network):
    with Node("sleeper", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.subscribe(SONAR, lambda message: threading.Event().wait(0.2))  # four of five are overrun by newer ones
        with spinning(node):
            told = topic_ends.ends(session, living_topics.topic_on(session, "sonar"))
    assert 10.0 < told.written_by["diver"].rate_hz < 40.0
    reader = told.read_by["sleeper"]
    assert reader.rate_hz is not None
    assert 1.0 < reader.rate_hz < 8.0
    assert reader.lost is not None
    assert reader.lost > 10


@pytest.mark.parametrize(
    ("path", "value"),
    [("", STATE), ("stamp", 5), ("position[1]", -2.0), ("position[-1]", -2.0), ("name", ("a", "b"))],
)
def test_a_field_is_found_by_its_path(path: str, value: object):
    assert FieldPath(JointState, path).of(STATE) == value


def test_a_field_of_a_message_within_a_message_is_found():
    path = FieldPath(FrameTransforms, "transforms[0].transform.translation[2]")
    assert path.of(moving(1)) == 0.2


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("positon", 'JointState has no field "positon": did you mean "position"?'),
        ("position[", "write it as position[0]"),
        ("position[2]", "[2] of 2 elements"),
        ("stamp[0]", "[0] of no elements"),
        ("position[0].x", 'no field "x"'),
    ],
)
def test_a_field_that_is_none_is_refused_by_name(path: str, said: str):
    with pytest.raises(CommandError, match=re.escape(said)):
        FieldPath(JointState, path).of(STATE)


def test_echo_of_a_field_is_a_value_a_line(session, stack, capsys):
    path = FieldPath(JointState, "position[1]")
    assert topic.echo(session, JOINT_STATES, path, json_line, 2) is ExitCode.OK
    assert [json.loads(line) for line in capsys.readouterr().out.splitlines()] == [0.25, 0.25]


def test_echo_as_csv_has_a_heading_and_a_row_a_message(session, stack, capsys):
    assert topic.echo(session, JOINT_STATES, FieldPath(JointState, ""), csv_lines(), 2) is ExitCode.OK
    heading, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert heading[:3] == ["stamp", "name[0]", "name[1]"]
    assert [row[heading.index("position[2]")] for row in rows] == ["0.04", "0.04"]


def test_leaves_have_every_number_once():
    assert dict(leaves(moving(7)))["transforms[0].transform.translation[0]"] == 0.1
    assert list(leaves(3.0)) == [("", 3.0)]


def test_the_bandwidth_is_measured(session, stack, capsys):
    assert topic_rates.bandwidth(session, JOINT_STATES, 1000, 1) is ExitCode.OK
    zero = (0.0, 0.0, 0.0)
    state = JointState(stamp=2**60, name=session.arm.joint_names, position=(0.5, 0.25, 0.04), velocity=zero)
    assert f"message size mean: {len(msgspec.msgpack.encode(state))} B" in capsys.readouterr().out


def test_the_delay_is_measured(session, stack, capsys):
    assert topic_rates.delay(session, JOINT_STATES, 1000, 1) is ExitCode.OK
    mean = re.match(r"average delay: ([\d.]+) ms", capsys.readouterr().out)
    assert mean is not None
    assert 0.0 <= float(mean[1]) < 1000.0


def test_topics_with_their_messages_a_line_each(capsys):
    assert run(["topic", "list", "-t"]) is ExitCode.OK
    assert "joint_states [JointState]" in capsys.readouterr().out.splitlines()


def test_the_pose_of_a_frame_in_another_is_said(session, frames, capsys):
    assert tf.echo(session, "base", "hand <1>", 50.0, 1, tf.pose_text, WHOLE) is ExitCode.OK
    said = capsys.readouterr().out
    assert "point       50.00 0.00 200.00 mm" in said
    assert "rpy         0.000 0.000 90.000 deg" in said


def test_the_pose_is_said_as_json_the_other_way_round(session, frames, capsys):
    assert tf.echo(session, "hand <1>", "base", 50.0, 1, json_line, WHOLE) is ExitCode.OK
    assert json.loads(capsys.readouterr().out)["parent"] == "hand <1>"


def test_a_frame_that_is_none_is_answered_with_the_nearest(session, frames):
    with pytest.raises(CommandError, match=r'no frame "bas".*"base"'):
        tf.echo(session, "bas", "arm", 50.0, 1, tf.pose_text, WHOLE)


def test_without_frames_the_one_who_sends_them_is_named(session):
    with pytest.raises(CommandError, match="state_publisher"):
        tf.heard(session)


def test_the_tree_has_every_frame_below_its_parent(session, frames):
    links = tf.heard(session).links
    assert tf.tree_text(links) == "base\n  arm\n    hand <1> (fixed)"
    picture = ET.fromstring(tf.tree_picture(links))
    assert [text.text for text in picture.iter("{http://www.w3.org/2000/svg}text")] == ["base", "arm", "hand <1>"]
    dashed = [path.get("stroke-dasharray") for path in picture.iter("{http://www.w3.org/2000/svg}path")]
    assert dashed == [None, "4 3"]


def test_frames_are_monitored(session, frames, capsys):
    assert tf.monitor(session, 1, tf.monitor_table) is ExitCode.OK
    (row,) = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("arm")]
    assert 25.0 < float(row[1]) < 100.0
    assert 0.0 <= float(row[2]) <= float(row[3]) < 1000.0


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_roll_pitch_and_yaw_are_those_that_were_given(roll: float, pitch: float, yaw: float):
    assert to_rpy(from_rpy(roll, pitch, yaw)) == pytest.approx((roll, pitch, yaw), abs=1e-9)


@given(
    st.floats(-3.1, 3.1),
    st.sampled_from([math.pi / 2, -math.pi / 2, 1.5708, -1.570796, math.pi / 2 - 1e-9]),
    st.floats(-3.1, 3.1),
)
def test_roll_and_yaw_at_a_right_angle_of_pitch_give_the_same_orientation(roll: float, pitch: float, yaw: float):
    orientation = from_rpy(roll, pitch, yaw)
    again = from_rpy(*to_rpy(orientation))
    assert abs(sum(first * second for first, second in zip(orientation, again, strict=True))) == pytest.approx(
        1.0, abs=1e-12
    )


def test_a_message_is_shown_with_its_units_and_where_it_travels(capsys):
    assert run(["interface", "show", "FrameTransforms"]) is ExitCode.OK
    said = capsys.readouterr().out
    assert "translation: Vector = (0.0, 0.0, 0.0)  # [m]" in said
    assert "# topic frames: poses of the moving links" in said
    assert run(["interface", "show", "joint_states"]) is ExitCode.OK
    assert "class JointState" in capsys.readouterr().out
    assert run(["interface", "show", "JointStat"]) is not ExitCode.OK
    assert 'did you mean "JointState"' in capsys.readouterr().err


def test_a_message_is_shown_as_its_json_schema(capsys):
    assert run(["interface", "show", "FrameTransforms", "--json"]) is ExitCode.OK
    schema = json.loads(capsys.readouterr().out)
    assert schema["$ref"] == "#/$defs/FrameTransforms"
    assert {"FrameTransforms", "Transform"} <= set(schema["$defs"])


def test_every_message_that_travels_is_shown():
    for kind in interface.messages().values():
        assert f"class {kind.__name__}(" in interface.text_of(kind)
        assert kind.__name__ in interface.schema_of(kind)["$defs"]


class Knobs(msgspec.Struct, frozen=True, kw_only=True):
    gain: Annotated[float, Meta(ge=0.0, le=2.0, description="of the thing")] = 1.0
    name: str = 'a "b"'
    on: bool = False


@pytest.fixture
def knobs(deployment, network) -> Iterator[Node]:
    with Node("thing", deployment, robot="rm1", bus=MemoryBus(network)) as node:
        node.parameters(Knobs)
        with spinning(node):
            yield node


def test_parameters_are_dumped_and_loaded(session, knobs, tmp_path: Path):
    text = node_parameters.dumped(session, ["thing"])
    assert 'gain" = 1.0  # of the thing' in text
    file = tmp_path / "knobs.toml"
    file.write_text(text)
    assert node_parameters.load(session, node_parameters.read(str(file))) == ["every parameter has that value already"]
    file.write_text(text.replace("1.0", "1.5").replace("false", "true"))
    lines = node_parameters.load(session, node_parameters.read(str(file)))
    assert lines == ["thing gain: 1.0 -> 1.5", "thing on: false -> true"]


def test_a_file_is_loaded_for_later_starts_too(session, knobs, deployment, tmp_path: Path):
    saved = Path(deployment.paths.run) / "parameters/thing.toml"
    (tmp_path / "knobs.toml").write_text('[thing]\ngain = 1.5\nname = "a \\"b\\""\n')
    lines = node_parameters.load(session, node_parameters.read(str(tmp_path / "knobs.toml")), save=True)
    assert lines == [
        f"thing gain: 1.0 -> 1.5, saved in {saved}",
        f'thing name: a "b" -> a "b", saved in {saved}',  # as it was, and kept
    ]
    assert tomllib.loads(saved.read_text()) == {"gain": 1.5, "name": 'a "b"'}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[thing]\non = true\ngain = 3.0", "3 is not in 0..2"),
        ("[thing]\non = true\ngan = 1.5", 'no parameter "gan": did you mean "gain"'),
        ('[thing]\non = true\ngain = "1.5"', "not a float"),
        ("[thing]\non = true\ngain = [1]", "one number, word or truth"),
        ("[thin]\non = true", 'no node "thin"'),
    ],
)
def test_a_file_with_a_mistake_changes_nothing(session, knobs, tmp_path: Path, text: str, said: str):
    before = node_parameters.dumped(session, ["thing"])
    (tmp_path / "knobs.toml").write_text(text)
    with pytest.raises(CommandError, match=re.escape(said)):
        node_parameters.load(session, node_parameters.read(str(tmp_path / "knobs.toml")))
    assert node_parameters.dumped(session, ["thing"]) == before


@pytest.mark.parametrize("text", [b"gain = 1.0", b"[thing", b"\xff"])
def test_a_file_that_is_none_is_refused(tmp_path: Path, text: bytes):
    (tmp_path / "knobs.toml").write_bytes(text)
    with pytest.raises(CommandError, match=r"knobs\.toml"):
        node_parameters.read(str(tmp_path / "knobs.toml"))


def test_the_figures_of_a_node_that_was_started_again_begin_anew(session, network):
    figures = top.figures_by_node(session)

    def say(started: int, seconds: int, received: int) -> None:
        topics = (TopicStatistics(key="joint_states", received=received),)
        statistics.put(NodeStatistics(stamp=seconds * 10**9, node="planner", started=started, topics=topics))

    statistics = Publisher(MemoryBus(network), STATISTICS, "planner")
    say(1, 7, 9_000)
    say(1, 8, 9_050)
    assert hear(session.node, lambda: "planner" in figures)
    say(2, 9, 10)
    assert hear(session.node, lambda: "planner" not in figures)
    say(2, 10, 60)
    assert hear(session.node, lambda: "planner" in figures)
    assert figures["planner"].received() == {"joint_states": 50.0}


def test_top_has_every_node_with_its_figures(session, stack, capsys):
    assert top.watch(session, 1) is ExitCode.OK
    (row,) = [line.split() for line in capsys.readouterr().out.splitlines() if line.startswith("stepper_gateway")]
    cpu, memory, loop = (float(cell) for cell in row[1:4])
    assert 0.0 <= cpu < 200.0
    assert memory > 10.0
    assert 25.0 < loop < 100.0


def test_top_says_what_was_lost_what_was_bad_and_how_late_a_loop_is(session, stack, deployment, network):
    reports: list[top.TopReport] = []
    with (
        Node("sleeper", deployment, robot="rm1", bus=MemoryBus(network), log_level="error") as node,
        closing(MemoryBus(network)) as stranger,
    ):
        # [s] three periods at rest: the step comes late, and newer states replace those that wait
        node.subscribe(JOINT_STATES, lambda state: threading.Event().wait(0.3))
        words = stranger.publish("log", "Nonsense", Delivery.EVERY, "stranger")
        node.subscribe(LOG, lambda record: None)
        with spinning(node, lambda now: words.put(b"not a record")):
            assert top.watch(session, 2, lambda report: reports.append(report) or "") is ExitCode.OK
    rows = {each.node: each for each in reports[-1].nodes}
    assert rows["sleeper"].lost > 5
    assert rows["sleeper"].bad > 0
    assert rows["sleeper"].loop_late_max > 0.05
    assert rows["sleeper"].loop_rate < 15.0
    assert (rows["stepper_gateway"].lost, rows["stepper_gateway"].bad) == (0, 0)
    line, slow = [each for each in str(reports[-1]).splitlines() if each.startswith("sleeper")]
    assert re.fullmatch(r"sleeper hears joint_states \d+\.\d times a second; stepper_gateway promises 10", slow)
    cells = dict(zip(top.HEADINGS, re.split(r" {2,}", line), strict=True))
    assert (int(cells["lost"]), int(cells["bad"])) == (rows["sleeper"].lost, rows["sleeper"].bad)
    assert float(cells["worst lateness [ms]"]) == pytest.approx(1e3 * rows["sleeper"].loop_late_max, abs=0.06)


def test_top_goes_on_where_a_node_hangs(session, stack, deployment, network):
    """One that spoke a moment ago, and now does not say what its process is."""
    reports: list[top.TopReport] = []
    with (
        Node("hanging", deployment, robot="rm1", bus=MemoryBus(network)),  # and nobody lets it spin
        Node("speaker", deployment, robot="rm1", bus=MemoryBus(network)) as speaker,
    ):
        words = Publisher(MemoryBus(network), STATISTICS, "hanging")
        with spinning(speaker, lambda now: words.put(NodeStatistics(stamp=now, node="hanging")), rate=1.0):
            assert top.watch(session, 1, lambda report: reports.append(report) or "") is ExitCode.OK
    rows = {each.node: each for each in reports[-1].nodes}
    assert rows["hanging"].memory is None
    assert rows["stepper_gateway"].memory is not None


def test_a_topic_that_comes_too_seldom_is_named_and_a_silent_one_is_not():
    def heard(stamp: int, states: int) -> NodeStatistics:
        topics = (TopicStatistics(key="joint_states", received=states), TopicStatistics(key="step_errors", received=9))
        return NodeStatistics(stamp=stamp, node="planner", topics=topics)

    second = 1_000_000_000
    slow = {"planner": top.Figures(heard(0, 10), heard(second, 16))}
    (line,) = top.slow_topics(slow)
    assert str(line) == "planner hears joint_states 6.0 times a second; stepper_gateway promises 10"
    assert list(top.slow_topics({"planner": top.Figures(heard(0, 10), heard(second, 20))})) == []  # at rest


def test_a_steady_stream_is_not_called_slow_for_one_message_on_the_other_side_of_a_second():
    """10 messages a second, of which the second between two reports has 9, 10 or 11."""

    def heard(stamp: int, count: int) -> NodeStatistics:
        return NodeStatistics(stamp=stamp, node="logger", topics=(TopicStatistics(key="joint_states", received=count),))

    at_rate = {count: top.Figures(heard(0, 0), heard(1_000_000_000, count)) for count in (7, 9, 10, 11)}
    slow = {count: list(top.slow_topics({"logger": each})) for count, each in at_rate.items()}
    assert [bool(slow[count]) for count in (7, 9, 10, 11)] == [True, False, False, False]


def test_a_goal_of_somebody_else_is_cancelled_and_one_that_is_none_is_named(session, connected, stack, planner):
    with pytest.raises(CommandError, match='no goal begins with "nobody"'):
        action_watch.cancel(session, FOLLOW_JOINT_TRAJECTORY, "nobody")
    motion = connected.start(joints=dict(zip(session.arm.joint_names, (0.0, 0.0, 0.0), strict=True)))
    (goal,) = action_watch.cancel(session, FOLLOW_JOINT_TRAJECTORY, motion.goal_id[:8])
    assert goal == motion.goal_id
    with pytest.raises(gemelo.Aborted):
        motion.wait()
    with pytest.raises(CommandError, match="nothing is cancelled"):
        action_watch.cancel(session, FOLLOW_JOINT_TRAJECTORY, "")


def test_a_goal_is_followed_to_its_result(session, connected, stack, planner, capsys):
    motion = connected.start(joints=dict(zip(session.arm.joint_names, (0.0, 0.0, 0.0), strict=True)))
    shown = action_watch.ActionView(FOLLOW_JOINT_TRAJECTORY)
    assert action_watch.echo(session, FOLLOW_JOINT_TRAJECTORY, 1, shown) is ExitCode.OK
    said = capsys.readouterr().out
    assert f"goal {motion.goal_id} of" in said
    assert "SUCCEEDED" in said
    assert "executed_steps: [933, -50, 113]" in said


def test_a_part_of_an_action_and_a_field_of_it_are_followed(
    arm, deployment, network, connected, stack, planner, capsys
):
    goal = dict(zip(arm.joint_names, (0.0, 0.0, 0.0), strict=True))

    def followed(part: str, path: str, form) -> list[str]:
        shown = action_watch.ActionView(FOLLOW_JOINT_TRAJECTORY, part, path, form)
        with Node("cli-3", deployment, robot="rm1", bus=MemoryBus(network)) as node:
            connected.start(joints=goal)
            session = CommandSession(deployment, arm, node)
            assert action_watch.echo(session, FOLLOW_JOINT_TRAJECTORY, 1, shown) is ExitCode.OK
        return capsys.readouterr().out.splitlines()

    assert followed("result", "executed_steps[1]", json_line) == ["-50"]
    (feedback,) = followed("feedback", "", json_line)
    assert json.loads(feedback)["feedback"]["duration"] == 0.4
    heading, row = csv.reader(followed("result", "", csv_lines()))
    assert row[heading.index("result.executed_steps[0]")] == "933"
    parts = [set(json.loads(line)) for line in followed("", "", json_line)]
    assert {"goal", "client", "status"} in parts
    assert parts[-1] == {"goal", "result"}


def test_a_part_that_an_action_has_not_is_answered_with_the_nearest(capsys):
    assert run(["action", "echo", "follow_joint_trajectory.resul"]) is ExitCode.USAGE
    assert 'did you mean "result"' in capsys.readouterr().err
    assert run(["action", "echo", "follow_joint_trajectory.result.executed_step"]) is ExitCode.USAGE
    assert 'did you mean "executed_steps"' in capsys.readouterr().err
    assert run(["action", "echo", "follow_joint_trajectory", "--csv"]) is ExitCode.USAGE
    assert "follow_joint_trajectory.feedback" in capsys.readouterr().err


@contextmanager
def asking(deployment, network, question) -> Iterator[None]:
    """A client that asks the same again and again."""
    with Node("client", deployment, robot="rm1", bus=MemoryBus(network)) as client:
        done = threading.Event()

        def ask() -> None:
            while not done.wait(0.02):
                client.call(DEVICE_STOP, question)

        thread = threading.Thread(target=ask)
        thread.start()
        yield
        done.set()
        thread.join(60.0)


def test_a_request_is_watched_with_its_question_and_its_answer(session, stack, deployment, network, capsys):
    """Zenoh shows a request to nobody but its server, which therefore says it again as a topic."""
    exchanges = exchanges_of(request.asked_on(session, "device/stop"))
    with asking(deployment, network, DeviceStopRequest(kind=StopKind.HOLD)):
        path = FieldPath(exchanges.message, "")
        assert topic.echo(session, exchanges, path, yaml_document, 1) is ExitCode.OK
    said = yaml.safe_load(capsys.readouterr().out.partition("---")[0])
    assert said["question"] == {"kind": "hold"}
    assert said["answer"]["accepted"] is True
    assert said["failure"] is None


def test_a_field_of_an_answer_is_watched(session, stack, deployment, network, capsys):
    exchanges = exchanges_of(request.asked_on(session, "device/stop"))
    with asking(deployment, network, DeviceStopRequest(kind=StopKind.HOLD)):
        path = FieldPath(exchanges.message, "answer.accepted")
        assert topic.echo(session, exchanges, path, csv_lines(), 2) is ExitCode.OK
    assert capsys.readouterr().out.splitlines() == ["value", "True", "True"]


def test_a_request_of_nobody_is_answered_with_the_nearest_of_all(session, stack):
    with pytest.raises(CommandError, match='did you mean "device/stop"'):
        request.asked_on(session, "device/stp")
