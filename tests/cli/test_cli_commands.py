"""The command as a person starts it: what it prints and how it ends, with no stack running."""

import json
import socket
import subprocess
import sys

import pytest
import yaml

from gemelo.schemas.topics import JOINT_TARGETS, TOPICS
from gemelo.tools.cli.bus.messages import message_of
from gemelo.tools.cli.bus.topic import topic_of
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.main import run
from tests.table import table


@pytest.fixture
def no_stack(monkeypatch):
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        port = unused.getsockname()[1]
    monkeypatch.setenv("GEMELO_ROUTER_PORT", str(port))
    return port


@pytest.mark.parametrize(
    "words", [["state"], ["move", "--named", "ready"], ["topic", "echo", "log"], ["node", "list"], ["hold"], ["log"]]
)
def test_without_a_stack_the_remedy_is_said(words, no_stack, capsys):
    assert run(words) is ExitCode.NO_STACK
    assert f"no router at 127.0.0.1:{no_stack}: start the twin with `make up`" in capsys.readouterr().err


def test_a_wrong_joint_is_refused_before_the_stack_is_asked(no_stack, capsys):
    assert run(["move", "--joints", "braso_joint=1"]) is ExitCode.USAGE
    assert 'did you mean "brazo_joint"' in capsys.readouterr().err


def test_degrees_for_the_lift_are_refused(no_stack, capsys):
    assert run(["move", "--joints", "efector_joint=30deg"]) is ExitCode.USAGE
    assert "slides: 30deg must be in m or mm" in capsys.readouterr().err


def test_every_topic_is_listed_with_its_unit_of_rate(capsys):
    assert run(["topic", "list"]) is ExitCode.OK
    text = capsys.readouterr().out
    assert "rate [Hz]" in text
    for topic in TOPICS:
        assert topic.key in text


@table("topic", [topic.key for topic in TOPICS])
def test_topic_info_is_yaml_with_every_field(topic, no_stack, capsys):
    assert run(["topic", "info", topic]) is ExitCode.OK
    shown = yaml.safe_load(capsys.readouterr().out)
    assert list(shown["fields"]) == list(topic_of(topic).message.__struct_fields__)


@pytest.mark.parametrize("words", [["request", "list"], ["action", "list"], ["version"], ["completion"]])
def test_what_needs_no_stack_runs_without_one(words, no_stack, capsys):
    assert run(words) is ExitCode.OK
    assert capsys.readouterr().out


def test_an_unknown_topic_is_answered_with_the_nearest(capsys):
    assert run(["topic", "echo", "joint_state"]) is ExitCode.USAGE
    assert 'no topic "joint_state": did you mean "joint_states"?' in capsys.readouterr().err


def test_a_mistyped_command_is_answered_with_the_nearest(capsys):
    with pytest.raises(SystemExit):
        run(["topic", "ehco"])
    assert 'did you mean "echo"' in capsys.readouterr().err


def test_a_wrong_argument_is_called_what_it_is(capsys):
    with pytest.raises(SystemExit):
        run(["output", "avanzar", "maybe"])
    assert 'no state "maybe": there is on, off' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("jog --joints q1=3deg/s", 'gemelo jog: "--joints" is no option: did you mean --joint?'),
        ("state --jsn", 'gemelo state: "--jsn" is no option: did you mean --json?'),
        ("jog --sideways 1", 'gemelo jog: "--sideways" is no option: there is --joint, --twist, --turn, --frame'),
        ("jog turn 20deg/s", 'gemelo jog: "turn" is one word too many: there is --joint, --twist'),
        ("move ready", 'gemelo move: "ready" stands without an option: did you mean --named ready?'),
        ("move a=1", 'gemelo move: "a=1" stands without an option: did you mean --joints a=1?'),
        ("move 0.3 0 0", 'gemelo move: "0.3" stands without an option: say one of --to, --joints, --named, --execute'),
        ("move --time 3", "gemelo move: say one of --to, --joints, --named, --execute"),
        ("scene add cup", "gemelo scene add: say one of --box,"),
        ("hold now", 'gemelo hold: "now" is one word too many: it has no options'),
    ],
)
def test_what_a_command_does_not_take_is_named_with_what_it_takes(line, said, capsys):
    with pytest.raises(SystemExit) as ended:
        run(line.split())
    shown = capsys.readouterr().err
    assert ended.value.code == ExitCode.USAGE
    assert shown.startswith(said)
    assert f"`{said.partition(':')[0]} --help`" in shown


def test_a_message_is_written_as_json():
    message = message_of(JOINT_TARGETS.message, '{"name": ["q1"], "position": [0.5]}')
    assert message.name == ("q1",)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "not a JointTargets"),
        ("[1]", "written as JSON"),
        ('{"nmae": ["q1"]}', 'did you mean "name"'),
        ('{"position": ["x"]}', "position"),
        ('{"position": [1e999]}', "not a JointTargets"),
    ],
)
def test_a_message_that_is_none_is_refused_with_its_field(text, reason):
    with pytest.raises(CommandError, match=reason):
        message_of(JOINT_TARGETS.message, text)


def test_a_reader_that_has_enough_ends_the_command_quietly():
    command = f"{sys.executable} -m gemelo.tools.cli.main topic list | head -1"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=30, check=False)
    assert done.stdout.startswith("topic")
    assert done.stderr == ""


def test_bash_takes_the_completion():
    script = (
        f"source <({sys.executable} -m gemelo.tools.cli.main completion); "
        "COMP_WORDS=(gemelo topic ec); COMP_CWORD=2; _gemelo; echo ${COMPREPLY[@]}; "
        "COMP_WORDS=(gemelo topic hz joint_s); COMP_CWORD=3; _gemelo; echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.split() == ["echo", "joint_states"]


def test_a_goal_may_come_from_a_file(tmp_path):
    from gemelo.tools.cli.bus.action import goal_text

    path = tmp_path / "goal.json"
    path.write_text(json.dumps({"goal_time_tolerance": 1.0}))
    assert goal_text(str(path)) == path.read_text()
    with pytest.raises(CommandError, match="cannot read the goal"):
        goal_text(str(tmp_path / "none.json"))
