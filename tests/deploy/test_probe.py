"""`deploy/probe`: ready means said so within the last three seconds."""

from __future__ import annotations

import os
import subprocess
import time

import pytest

from services.runtime.deployment import project_root

ROOT = project_root()


def probe(name, **environment):
    return subprocess.run(
        ["deploy/probe", name],
        cwd=ROOT,
        env={"PATH": os.environ["PATH"], **environment},
        capture_output=True,
        text=True,
    )


@pytest.mark.parametrize(("age", "code"), [(0.0, 0), (2.0, 0), (4.0, 1), (3600.0, 1)])
def test_a_node_is_ready_while_its_file_is_young(tmp_path, age, code):
    file = tmp_path / "planner.ready"
    file.write_text("1")
    os.utime(file, (time.time() - age,) * 2)
    assert probe("planner", GEMELO_PATHS_RUN=str(tmp_path)).returncode == code


def test_a_node_without_a_file_is_not_ready(tmp_path):
    answer = probe("planner", GEMELO_PATHS_RUN=str(tmp_path))
    assert answer.returncode == 1
    assert "planner is not ready" in answer.stdout


def test_a_node_that_says_why_it_is_not_ready_is_quoted(tmp_path):
    (tmp_path / "planner.problem").write_text("no fresh joint_states\n")
    answer = probe("planner", GEMELO_PATHS_RUN=str(tmp_path))
    assert (answer.returncode, answer.stdout) == (1, "planner is not ready: no fresh joint_states\n")


def test_the_folder_may_stand_in_the_deployment_file(tmp_path):
    (tmp_path / "logger.ready").write_text("1")
    config = tmp_path / "bench.toml"
    config.write_text(f'[mqtt]\nport = 1\n[paths]\nrun = "{tmp_path}" # here\nout = "out"\n')
    assert probe("logger", GEMELO_CONFIG=str(config)).returncode == 0


def test_the_local_deployment_has_the_default_folder(tmp_path):
    assert ".gemelo/run/absent.ready" in probe("absent").stdout
