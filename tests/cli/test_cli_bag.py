"""`gemelo bag` as a person types it: on a real router, and every mistake answered with one sentence."""

from __future__ import annotations

import json
import re
import threading
from pathlib import Path

import pytest
from mcap.reader import make_reader

import gemelo
from schemas.joints import JointState
from schemas.topics import DESCRIPTION, JOINT_STATES, Delivery, Topic
from services.arm.model.description import load_arm
from services.cli.errors import ExitCode
from services.cli.main import run
from services.recordings.channels import Entry
from services.recordings.mcap_file import McapFile
from services.runtime.deployment import load_deployment
from services.runtime.node import Node
from services.state_publisher.main import describe
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


def test_a_living_robots_name_is_never_played_under(router, bag, capsys):
    assert run(["bag", "play", str(bag), "--as", "rm1"]) is ExitCode.FAILED
    with Node("stepper_gateway", robot="other") as gateway, spinning(gateway):
        assert run(["bag", "play", str(bag), "--as", "other"]) is ExitCode.FAILED
    first, second = capsys.readouterr().err.splitlines()
    assert "refused: rm1 is a living robot's name" in first
    assert "refused: other is a living robot's name" in second
    assert "--as other-replay" in second


def test_chosen_topics_are_recorded_into_files_that_are_split(router, tmp_path, capsys):
    name = tmp_path / "mine"
    done = threading.Event()
    codes = []

    def speak() -> None:
        with Node("tester", robot="rm1") as tester, Node("stepper_gateway", robot="rm1") as gateway:
            own, states = tester.publisher(OWN), gateway.publisher(JOINT_STATES)
            count = 0

            def step(now: int) -> None:
                nonlocal count
                count += 1
                own.put(JointState(stamp=count, name=("own",)))
                states.put(JointState(stamp=count, name=("x" * 500 + str(count),)))
                if done.is_set():
                    tester.stop()

            with spinning(gateway):
                tester.spin(step, rate=50.0)

    thread = threading.Thread(target=speak)
    thread.start()
    try:
        arguments = ["bag", "record", "test/*", "joint_states", "-o", str(name), "--compression", "none"]
        codes.append(run([*arguments, "--max-mb", "0.1", "--duration", "4"]))
    finally:
        done.set()
        thread.join(10.0)
    assert codes == [ExitCode.OK]
    files = sorted(tmp_path.glob("mine_*.mcap"))
    assert len(files) >= 2
    topics: dict[str, int] = {}
    for path in files:
        with path.open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                assert json.loads(message.data)["stamp"] > 0
                topics[channel.topic] = topics.get(channel.topic, 0) + 1
    assert set(topics) == {"joint_states", "test/own"}
    assert topics["joint_states"] > 100
    assert "messages in" in capsys.readouterr().out


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
        (["info", "{folder}"], "is a folder: name one file in it, as"),
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
