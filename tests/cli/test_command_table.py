"""The table of commands: every name in it resolves, nothing else is loaded, and the arm's files are read once."""

from __future__ import annotations

import inspect
import subprocess
import sys

import pytest

from gemelo.libraries.arm.model import description
from gemelo.tools.cli.commands import COMMANDS, GROUPS
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.main import parse, run
from tests.table import table

SPEAKING = (
    "move --named ready", "state", "hold", "reference --joints brazo_joint=0", "home brazo_joint", "output avanzar on",
    "sensors", "speed 0", "jog --joint brazo_joint=0 --for 1", "ik --to 0.2 0.1 0.1", "fk brazo_joint=0",
    "device status", "device monitor", "device config", "device arm", "device press estop", "topic echo log",
    "topic hz log", "request call plan", "scene list", "node list", "param list", "log",
)  # fmt: skip

WATCHING = (
    "topic echo joint_states.position[0]", "topic hz joint_states", "topic bw joint_states", "topic delay joint_states",
    "tf echo base_link tool_link", "tf monitor", "request echo plan.answer",
    "action echo follow_joint_trajectory.result", "top", "log",
)  # fmt: skip
TABLES = (
    "topic list", "topic info joint_states", "tf tree", "request list", "request call plan", "action list",
    "action info follow_joint_trajectory", "param list", "param get logger log_dir", "param describe logger log_dir",
    "node list", "node info planner", "device monitor --once", "scene list", "doctor", "blackbox list",
)  # fmt: skip


@table("command", COMMANDS, ids=lambda command: " ".join(command.words))
def test_every_function_of_the_table_takes_one_argument(command):
    for name in ("run", "add_options", "choices"):
        if getattr(command, name):
            assert len(inspect.signature(command.load(name)).parameters) == 1, getattr(command, name)


def test_every_group_of_the_table_has_its_line_of_help():
    assert {command.words[0] for command in COMMANDS if len(command.words) > 1} == set(GROUPS)


@table("command", [each for each in COMMANDS if each.example], ids=lambda each: each.example)
def test_every_example_of_the_table_can_be_typed(command):
    options = parse(command.example.split()[1:])
    assert options.command is command


@table("line", WATCHING)
def test_whatever_watches_the_bus_can_end_after_one_or_some_and_speak_to_programs(line):
    once = parse([*line.split(), "--once", "--json"])
    assert (once.count, once.json) == (1, True)
    some = parse([*line.split(), "-n", "3", "--csv"])
    assert (some.count, some.csv) == (3, True)


@table("line", TABLES)
def test_whatever_is_listed_is_listed_for_programs_too(line):
    assert parse([*line.split(), "--json"]).json


@pytest.mark.parametrize("line", SPEAKING)
def test_the_arms_files_are_read_once_for_a_command(line, monkeypatch, capsys):
    read = []
    load_arm = description.load_arm
    monkeypatch.setattr(description, "load_arm", lambda folder: read.append(folder) or load_arm(folder))
    monkeypatch.setenv("GEMELO_ROUTER_PORT", "1")
    assert run(line.split()) is ExitCode.NO_STACK
    assert len(read) == 1
    assert "no router" in capsys.readouterr().err


def test_completion_reads_the_arms_files_once_and_knows_its_names(monkeypatch, capsys):
    read = []
    load_arm = description.load_arm
    monkeypatch.setattr(description, "load_arm", lambda folder: read.append(folder) or load_arm(folder))
    assert run(["completion"]) is ExitCode.OK
    assert len(read) == 1
    assert '"output avanzar") words="on off"' in capsys.readouterr().out


def test_a_robot_that_cannot_be_read_still_completes_the_commands(monkeypatch, capsys):
    monkeypatch.setenv("GEMELO_ROBOT", "urdf/nobody")
    assert run(["completion"]) is ExitCode.OK
    printed = capsys.readouterr().out
    assert '"device press") words="estop release' in printed
    assert '"move") words="--to --joints' in printed
    assert "brazo_joint" not in printed


@pytest.mark.parametrize(
    ("line", "absent"),
    [
        (["--help"], ("msgspec", "numpy", "zenoh", "gemelo.tools.cli.motion.move", "gemelo.tools.cli.bus.topic")),
        (
            ["topic", "list"],
            (
                "numpy",
                "zenoh",
                "gemelo.libraries.arm.model.description",
                "gemelo.tools.cli.motion.move",
                "gemelo.libraries.runtime.actions",
            ),
        ),
        (["move", "--help"], ("numpy", "zenoh", "rich", "gemelo.tools.cli.motion.jog")),
    ],
)
def test_a_command_loads_nothing_that_it_does_not_use(line, absent):
    program = (
        "import sys\nfrom gemelo.tools.cli.main import run\n"
        f"try:\n    run({line!r})\nexcept SystemExit:\n    pass\nprint(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=30, check=True)
    assert done.stdout.strip()
    assert not set(absent) & set(done.stderr.split())
