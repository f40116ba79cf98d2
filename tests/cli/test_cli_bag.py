"""`gemelo bag` as a person types it: on a real router, and every mistake answered with one sentence."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

import gemelo
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.recordings.channels import Entry
from gemelo.libraries.recordings.mcap_file import McapFile
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DESCRIPTION, JOINT_STATES, Delivery, Topic
from gemelo.services.state_publisher.main import describe
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.program.rerun_program import rerun_binary
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import run
from tests.runtime.support import spinning, until

START = 1_795_000_000_000_000_000
ROOT = Path(__file__).parents[2]
OWN = Topic("test/own", JointState, Delivery.EVERY, None, True, "tester", "a user's own")


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Half a second of rm1."""
    file = McapFile(tmp_path / "bag.mcap", {})
    file.write([Entry(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")), START)])
    states = [JointState(stamp=START + k, name=("brazo_joint",), position=(0.01 * k,)) for k in range(25)]
    file.write(Entry(JOINT_STATES, state, START + k * 20_000_000) for k, state in enumerate(states))
    file.close()
    return file.path


def test_a_recording_is_played_as_a_shadow_that_a_reader_of_that_name_hears(router, bag, tmp_path, capsys):
    heard: list[JointState] = []
    with Node("tool", robot="rm1-replay") as tool, Node("other", robot="rm1") as living:
        tool.subscribe(JOINT_STATES, heard.append, batch=0.01)
        description = tool.latest(DESCRIPTION)
        astray: list[JointState] = []
        living.subscribe(JOINT_STATES, astray.append)
        with spinning(tool), spinning(living):
            assert run(["bag", "play", str(bag)]) is ExitCode.OK
            assert until(lambda: heard and heard[-1].position[0] == 0.01 * 24)
    positions = [state.position[0] for state in heard]
    assert positions[0] == 0.0
    assert positions == [0.01 * k for k in range(25) if 0.01 * k in positions]  # a LATEST topic may leave some out
    assert len(positions) > 15
    assert description.message is not None
    assert not astray
    out = capsys.readouterr().out
    assert "playing as rm1-replay" in out
    assert "played 26 messages" in out
    shadow = gemelo.load_robot(str(tmp_path / "out/shadows/rm1-replay"))
    assert shadow.description.name == "rm1-replay"
    assert shadow.description.joint_names == load_arm(ROOT / "urdf/rm1").joint_names


@pytest.fixture
def ten_seconds(tmp_path: Path) -> Path:
    """The arm, and ten seconds of a topic that loses none."""
    file = McapFile(tmp_path / "long.mcap", {})
    file.write([Entry(DESCRIPTION, describe(load_arm(ROOT / "urdf/rm1")), START)])
    file.write(Entry(OWN, JointState(stamp=k), START + k * 50_000_000) for k in range(200))
    file.close()
    return file.path


@contextmanager
def hearing(heard: list[tuple[float, int]]) -> Iterator[None]:
    """What is played, each with when [s] it came."""
    with Node("tool", robot="rm1-replay") as tool:
        tool.subscribe(OWN, lambda state: heard.append((tool.monotonic(), state.stamp)))
        with spinning(tool):
            yield


def test_a_recording_is_played_from_a_time_on_at_another_rate(router, ten_seconds, capsys):
    heard: list[tuple[float, int]] = []
    with hearing(heard):
        assert run(["bag", "play", str(ten_seconds), "--start", "4", "--rate", "2"]) is ExitCode.OK
        assert until(lambda: heard and heard[-1][1] == 199)
    assert [stamp for _, stamp in heard] == list(range(80, 200))
    took = heard[-1][0] - heard[0][0]  # [s] of 119 periods of 50 ms at twice the speed
    assert 2.5 < took < 6.0
    assert "played 121 messages, up to" in capsys.readouterr().out  # the description of before among them


def test_a_recording_is_played_again_and_again_until_it_is_ended(router, ten_seconds):
    heard: list[tuple[float, int]] = []
    with hearing(heard):
        command = [sys.executable, "-m", "gemelo.tools.cli.main", "bag", "play", str(ten_seconds)]
        with subprocess.Popen([*command, "--loop", "--rate", "10", "--start", "5"], cwd=ROOT) as playing:
            try:
                assert until(lambda: len(heard) > 250, 40.0)
                assert playing.poll() is None
                playing.send_signal(signal.SIGINT)
                assert playing.wait(20.0) == 0
            finally:
                playing.kill()
    stamps = [stamp for _, stamp in heard]
    assert stamps == [100 + k % 100 for k in range(len(stamps))]


def test_the_view_of_a_shadow_robot_shows_what_is_played(router, bag, tmp_path):
    """The visualizer itself, as a process that is told nothing but the shadow's folder."""
    shadow, view, heard = tmp_path / "out/shadows/rm1-replay", tmp_path / "view.rrd", list[JointState]()
    play = [sys.executable, "-m", "gemelo.tools.cli.main", "bag", "play", str(bag), "--loop"]
    show = [sys.executable, "-m", "gemelo.services.visualizer.main", "--set", f"recording_path={view}"]
    environment = os.environ | {"GEMELO_ROBOT": str(shadow), "GEMELO_VIEWER_MODE": "none"}
    with Node("tool", robot="rm1-replay") as tool, subprocess.Popen(play, cwd=ROOT) as playing:
        tool.subscribe(JOINT_STATES, heard.append)
        try:
            with spinning(tool):
                assert until(lambda: heard, 30.0)
                with subprocess.Popen(show, cwd=ROOT, env=environment) as visualizer:
                    try:
                        assert until((tmp_path / "run/visualizer.ready").exists, 30.0)
                        count = len(heard)
                        assert until(lambda: len(heard) > count + 25, 30.0)
                    finally:
                        visualizer.terminate()
                        assert visualizer.wait(20.0) == 0
        finally:
            playing.kill()
    text = subprocess.run([rerun_binary(), "rrd", "print", view], capture_output=True, text=True, check=True).stdout
    assert f"/{entities.executed('brazo_joint')}" in text
    assert f"/{entities.MEASURED}/base_link/brazo_link" in text


def test_a_living_robots_name_is_never_played_under(router, bag, capsys):
    assert run(["bag", "play", str(bag), "--as", "rm1"]) is ExitCode.FAILED
    with Node("stepper_gateway", robot="other") as gateway, spinning(gateway):
        assert run(["bag", "play", str(bag), "--as", "other"]) is ExitCode.FAILED
    first, second = capsys.readouterr().err.splitlines()
    assert "refused: rm1 is a living robot's name" in first
    assert "refused: other is a living robot's name" in second
    assert "--as other-replay" in second


@contextmanager
def speaking() -> Iterator[None]:
    """A topic of a user's own, and joint states of half a kilobyte, fifty times a second."""
    with Node("tester", robot="rm1") as tester, Node("stepper_gateway", robot="rm1") as gateway:
        own, states = tester.publisher(OWN), gateway.publisher(JOINT_STATES)
        count = 0

        def step(now: int) -> None:
            nonlocal count
            count += 1
            own.put(JointState(stamp=count, name=("own",)))
            states.put(JointState(stamp=count, name=("x" * 500 + str(count),)))

        with spinning(gateway), spinning(tester, step):
            yield


def messages_in(path: Path) -> list[tuple[str, int, int]]:
    """Topic, stamp in the message and time [ns] of arrival of each."""
    with path.open("rb") as file:
        return [
            (channel.topic, json.loads(message.data)["stamp"], message.log_time)
            for _, channel, message in make_reader(file).iter_messages()
        ]


def test_chosen_topics_are_recorded_into_files_that_are_split(router, tmp_path, capsys):
    name = tmp_path / "mine"
    arguments = ["bag", "record", "test/*", "joint_states", "-o", str(name), "--compression", "none"]
    with speaking():
        assert run([*arguments, "--max-mb", "0.02", "--duration", "4"]) is ExitCode.OK
    files = sorted(tmp_path.glob("mine_*.mcap"))
    assert len(files) >= 2
    stamps: dict[str, list[int]] = {}
    for path in files:
        for topic, stamp, _ in messages_in(path):
            stamps.setdefault(topic, []).append(stamp)
    assert set(stamps) == {"joint_states", "test/own"}
    for each in stamps.values():  # none is lost between two files
        assert each == list(range(each[0], each[0] + len(each)))
    assert "messages in" in capsys.readouterr().out


def test_a_recording_is_split_by_time_and_nothing_is_lost_in_between(router, tmp_path):
    minutes = 0.02
    arguments = ["bag", "record", "joint_states", "-o", str(tmp_path / "mine"), "--max-minutes", str(minutes)]
    with speaking():
        assert run([*arguments, "--duration", "5"]) is ExitCode.OK
    files = sorted(tmp_path.glob("mine_*.mcap"))
    assert [path.name for path in files] == [f"mine_{number}.mcap" for number in range(1, len(files) + 1)]
    assert len(files) >= 3
    parts = [messages_in(path) for path in files]
    for part in parts[:-1]:
        lasts = (part[-1][2] - part[0][2]) / 60e9
        assert 0.2 * minutes < lasts < 5.0 * minutes  # it is looked twice a second whether it is time
    stamps = [stamp for part in parts for _, stamp, _ in part]
    assert stamps == list(range(stamps[0], stamps[0] + len(stamps)))


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_a_recording_is_compressed_as_it_was_asked_for(router, tmp_path, compression):
    arguments = ["bag", "record", "joint_states", "-o", str(tmp_path / "mine"), "--compression", compression]
    with speaking():
        assert run([*arguments, "--duration", "2"]) is ExitCode.OK
    path = tmp_path / "mine.mcap"
    with path.open("rb") as file:
        chunks = [each for each in StreamReader(file, emit_chunks=True).records if isinstance(each, Chunk)]
    assert {each.compression for each in chunks} == {"" if compression == "none" else compression}
    size, plain = (
        sum(sizes) for sizes in zip(*((len(each.data), each.uncompressed_size) for each in chunks), strict=True)
    )
    assert size == plain if compression == "none" else size < 0.5 * plain
    assert len(messages_in(path)) > 20


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["play", "{bag}", "--rate", "0"], '"0" cannot be: write how many times real time'),
        (["play", "{bag}", "--rate", "nan"], '"nan" cannot be'),
        (["play", "{bag}", "--start", "-1"], '"-1" cannot be: write seconds'),
        (["play", "{bag}", "--start", "99"], "--start 99: the recording has no message after that"),
        (["play", "{bag}", "--as", "a/b"], '--as "a/b": letters, digits'),
        (["play", "{bag}", "joint_stats"], 'no topic matches "joint_stats"'),
        (["export", "{bag}", "--to", "exel"], 'no form "exel"'),
        (["info", "{folder}"], "is a folder: name one file in it; the newest is"),
        (["info", "{folder}/none.mcap"], "there is no file"),
        (["record", "--compression", "gzip"], 'no compression "gzip"'),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_mistake_is_answered_with_one_sentence(bag, capsys, arguments, said):
    given = [each.format(bag=bag, folder=bag.parent) for each in arguments]
    try:
        code = run(["bag", *given])
    except SystemExit as end:
        code = end.code
    assert code == ExitCode.USAGE
    error = capsys.readouterr().err
    assert re.search(said, error), error
    assert "Traceback" not in error


def test_what_is_in_a_recording_is_said_as_text_and_as_json(bag, capsys):
    assert run(["bag", "info", str(bag)]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "messages  26 on 2 topics" in text
    assert run(["bag", "info", str(bag), "--json"]) is ExitCode.OK
    said = json.loads(capsys.readouterr().out)
    assert said["duration"] == pytest.approx(0.48)
    assert {each["topic"]: each["count"] for each in said["topics"]} == {"description": 1, "joint_states": 25}


def test_repair_says_what_is_saved_and_what_is_lost(bag, tmp_path, capsys):
    assert run(["bag", "repair", str(bag)]) is ExitCode.OK
    assert "nothing to repair" in capsys.readouterr().out
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(bag.read_bytes()[: bag.stat().st_size // 2])
    assert run(["bag", "repair", str(cut)]) is ExitCode.OK
    out = capsys.readouterr().out
    assert "saved " in out
    assert "lost: " in out
    assert run(["bag", "repair", str(cut)]) is ExitCode.FAILED
    assert "is there already" in capsys.readouterr().err


def test_the_robot_of_one_command_is_chosen_before_it(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROBOT", "")
    assert run(["--robot", "parol6", "version"]) is ExitCode.OK
    assert load_deployment().robot.endswith("urdf/parol6")
    assert run(["--robot", "parol7", "version"]) is ExitCode.USAGE
    assert 'no robot "parol7": did you mean "parol6"' in capsys.readouterr().err
