"""The preconditions of chaos: its stack's state before it starts."""

import tomllib
from pathlib import Path

import pytest

from gemelo.libraries.runtime.deployment import DEFAULT_FILE, load_deployment, project_root
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.schemas.deployment import Wire
from gemelo.tools.chaos.site import ChaosSite, processes_of, with_wire
from gemelo.tools.stack.stack import PROCESSES


def test_everything_that_a_stack_may_run_runs_in_chaos_and_less_in_a_soak(tmp_path: Path):
    sites = [
        ChaosSite(tmp_path / str(is_judged), "embedded", seed=1, is_judged=is_judged) for is_judged in (True, False)
    ]
    try:
        assert sites[0].stack.processes == processes_of(load_deployment()) == PROCESSES
        assert set(PROCESSES) - set(sites[1].stack.processes) == {"viewer", "panel", "camera", "detector"}
    finally:
        for site in sites:
            site.stack.stop()


def test_the_logger_keeps_every_recording_of_a_long_run(tmp_path: Path):
    site = ChaosSite(tmp_path, "embedded", seed=1, is_judged=False)
    try:
        assert SavedParameters(site.stack.run, "logger").read() == {"keep_files": 0}
    finally:
        site.stack.stop()


@pytest.mark.parametrize("before", ['wire = "mqtt"  # or serial\n[mqtt]\nport = 1\n', "[mqtt]\nport = 1\n"])
def test_a_deployment_gets_another_wire_and_keeps_the_rest(before: str):
    assert tomllib.loads(with_wire(before, Wire.SERIAL)) == {"wire": "serial", "mqtt": {"port": 1}}
    assert with_wire(with_wire(before, Wire.SERIAL), Wire.MQTT).count("wire =") == 1


def test_the_stack_is_started_with_the_deployment_of_its_user_over_mqtt(tmp_path: Path):
    site = ChaosSite(tmp_path, "embedded", seed=1, is_judged=False)
    try:
        environment = site.stack.environment
        own = load_deployment(project_root() / DEFAULT_FILE, {})
        found = load_deployment(None, {"GEMELO_CONFIG": environment["GEMELO_CONFIG"]})
        assert (found.wire, found.robot, found.parameters) == (Wire.MQTT, own.robot, own.parameters)
        assert load_deployment(None, environment).wire is Wire.MQTT
    finally:
        site.stack.stop()
