"""process-compose.yaml agrees with the console scripts, the table of keys and the Makefile."""

from __future__ import annotations

import re
import tomllib

import yaml

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.topics import ACTIONS, REQUESTS, TOPICS
from gemelo.tools.stack.stack import PROCESSES

ROOT = project_root()
COMPOSE = yaml.safe_load((ROOT / "process-compose.yaml").read_text())
SCRIPTS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]


def test_the_processes_are_those_that_the_stack_names():
    assert set(PROCESSES) == set(COMPOSE["processes"]) - {"about"}


def test_every_process_is_the_console_script_of_its_name():
    for name in PROCESSES:
        script = f"gemelo-{name.replace('_', '-')}"
        assert script in SCRIPTS
        assert COMPOSE["processes"][name]["command"] == f"exec .venv/bin/{script} 2>&1"


def test_every_console_script_is_a_process_or_the_command_line_or_started_by_hand():
    by_hand = {"gemelo", "gemelo-ros-bridge"}
    assert {f"gemelo-{name.replace('_', '-')}" for name in PROCESSES} | by_hand == set(SCRIPTS)


def test_every_writer_and_server_of_the_table_is_a_process():
    roles = {topic.writer for topic in TOPICS} | {each.server for each in (*REQUESTS, *ACTIONS)}
    assert roles - {"any"} <= set(PROCESSES)


def test_every_process_says_when_it_is_ready_and_is_started_again():
    for name in PROCESSES:
        process = COMPOSE["processes"][name]
        assert process["readiness_probe"]["exec"]["command"] == f"deploy/probe {name}"
        assert process["availability"]["restart"] == ("on_failure" if name == "viewer" else "always")
        assert process["shutdown"]["signal"] == 15


def test_process_compose_itself_opens_no_port():
    assert re.search(r"^PC_SOCKET_PATH=\.gemelo/", (ROOT / ".pc_env").read_text(), re.MULTILINE)


def test_the_welcome_waits_for_everything():
    conditions = {name: each["condition"] for name, each in COMPOSE["processes"]["about"]["depends_on"].items()}
    assert conditions == dict.fromkeys(PROCESSES, "process_healthy")
