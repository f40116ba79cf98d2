"""The file of the run: a command of the same folder goes by what `make up` was started with."""

from __future__ import annotations

from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.started import (
    choose_name,
    chosen_name,
    keep_started,
    load_started,
    started_file,
    with_started,
)

ROOT = str(project_root())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The environment of a terminal in a folder whose file of the run stands in a folder of its own."""
    monkeypatch.setenv("GEMELO_STARTED", str(tmp_path / "run/started.toml"))
    return {"GEMELO_STARTED": str(tmp_path / "run/started.toml")}


def test_a_second_terminal_has_what_make_up_was_started_with(folder):
    keep_started({**folder, "GEMELO_ROBOT": "urdf/parol6", "GEMELO_ROUTER_PORT": "7555", "GEMELO_PATHS_OUT": "else"})
    found = load_started(folder)
    assert (found.robot, found.router.port, found.paths.out) == (f"{ROOT}/urdf/parol6", 7555, f"{ROOT}/else")


def test_what_a_terminal_says_itself_goes_before_it(folder):
    keep_started({**folder, "GEMELO_ROBOT": "urdf/parol6", "GEMELO_MQTT_PORT": "1999"})
    found = load_started({**folder, "GEMELO_ROBOT": "urdf/rm1"})
    assert (found.robot, found.mqtt.port) == (f"{ROOT}/urdf/rm1", 1999)


def test_a_terminal_with_another_router_or_deployment_is_for_another_twin(folder, tmp_path):
    keep_started({**folder, "GEMELO_ROBOT": "urdf/parol6", "GEMELO_ROUTER_PORT": "7555"})
    assert load_started({**folder, "GEMELO_ROUTER_PORT": "7556"}).robot == f"{ROOT}/urdf/rm1"
    own = tmp_path / "own.toml"
    own.write_text('robot = "urdf/rm1"\n')
    assert load_started({**folder, "GEMELO_CONFIG": str(own)}).router.port == 7447
    assert load_started({**folder, "GEMELO_ROUTER_PORT": "7555"}).robot == f"{ROOT}/urdf/parol6"


def test_the_next_start_without_variables_forgets_them(folder):
    keep_started({**folder, "GEMELO_ROBOT": "urdf/parol6"})
    keep_started(folder)
    assert load_started(folder).robot == f"{ROOT}/urdf/rm1"


def test_a_deployment_file_is_kept_by_its_whole_path(folder, tmp_path, monkeypatch):
    (tmp_path / "mine.toml").write_text("[router]\nport = 7666\n")
    monkeypatch.chdir(tmp_path)
    keep_started({**folder, "GEMELO_CONFIG": "mine.toml"})
    monkeypatch.chdir("/")
    assert load_started(folder).router.port == 7666


@pytest.mark.parametrize("content", ["", "not = [toml", "GEMELO_ROBOT = 4\n"])
def test_a_damaged_file_says_nothing(folder, content):
    started_file(folder).parent.mkdir(parents=True)
    started_file(folder).write_text(content)
    assert with_started(folder) == folder


def test_the_choice_of_a_folder_is_kept_until_it_is_taken_back(folder):
    assert chosen_name() == ""
    choose_name("parol6")
    assert chosen_name() == "parol6"
    choose_name("")
    assert chosen_name() == ""
