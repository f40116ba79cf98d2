"""`deploy/probe`: ready means said so within the last three seconds."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from tests.runtime.support import until

ROOT = project_root()


def probe(name, *words, **environment):
    return subprocess.run(
        ["deploy/probe", name, *words],
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


def uptime() -> int:
    with open("/proc/uptime") as file:
        return int(float(file.read().split()[0]))


@pytest.mark.parametrize(
    ("file_age", "look_age", "said", "code"),
    [
        (1.0, 1.5, 1, 0),
        (2.9, 3.5, 3, 0),  # by its own age
        (4.0, 3.5, 3, 1),
        (4.0, 4.5, 4, 1),
        (4.0, 3600.0, 3600, 1),
        (4.0, 4.5, -50, 1),  # of another boot
        (4.0, 4.5, None, 1),
        (0.5, 4.5, None, 0),
    ],
)
def test_an_earlier_look_never_makes_an_old_file_young(tmp_path, file_age, look_age, said, code):
    """The look was `look_age` [s] ago by its file, and `said` [s] ago by what is in it."""
    for name, age, content in (
        ("ready", file_age, "1"),
        ("probed", look_age, "nonsense" if said is None else f"{uptime() - said}"),
    ):
        file = tmp_path / f"planner.{name}"
        file.write_text(f"{content}\n")
        os.utime(file, (time.time() - age,) * 2)
    assert probe("planner", GEMELO_PATHS_RUN=str(tmp_path)).returncode == code


def test_a_second_look_at_a_file_that_was_touched_since_starts_no_other_program(tmp_path):
    file, programs = tmp_path / "planner.ready", tmp_path / "programs"
    programs.mkdir()
    file.write_text("1")
    assert probe("planner", GEMELO_PATHS_RUN=str(tmp_path)).returncode == 0
    os.utime(file, (time.time() + 0.01,) * 2)
    without = subprocess.run(
        ["/bin/sh", "deploy/probe", "planner"], cwd=ROOT, env={"PATH": str(programs), "GEMELO_PATHS_RUN": str(tmp_path)}
    )
    assert without.returncode == 0
    file.unlink()
    assert probe("planner", GEMELO_PATHS_RUN=str(tmp_path)).returncode == 1


def test_a_folder_that_takes_no_file_changes_no_answer(tmp_path):
    file = tmp_path / "planner.ready"
    file.write_text("1")
    (tmp_path / "planner.probed").mkdir()
    for _ in range(2):
        answer = probe("planner", GEMELO_PATHS_RUN=str(tmp_path))
        assert (answer.returncode, answer.stderr) == (0, "")


def test_without_a_node_it_prints_the_folder(tmp_path):
    config = tmp_path / "bench.toml"
    config.write_text('[paths]\nrun = "elsewhere"\n')
    folder = subprocess.run(
        ["deploy/probe"], cwd=ROOT, env={"PATH": os.environ["PATH"], "GEMELO_CONFIG": str(config)},
        capture_output=True, text=True, check=True,
    ).stdout.strip()  # fmt: skip
    assert folder == "elsewhere"
    (tmp_path / "planner.ready").write_text("1")
    assert probe("planner", PROBE_RUN=str(tmp_path)).returncode == 0


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


BEATS = """
import sys, time
from pathlib import Path
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
readiness = Readiness(Path(sys.argv[1]), "gateway", UnwrittenFiles(print))
while True:
    readiness.beat()
    time.sleep(0.1)
"""


@pytest.fixture
def beating(tmp_path) -> Iterator[subprocess.Popen[bytes]]:
    """A process whose board is off: it is not ready, and its loop runs."""
    process = subprocess.Popen([sys.executable, "-c", BEATS, str(tmp_path)], cwd=ROOT)
    try:
        alive = tmp_path / "gateway.alive"
        assert until(lambda: alive.exists() and alive.read_text(), 20.0)
        yield process
    finally:
        process.kill()
        process.wait()


def age(folder, name: str, seconds: float) -> None:
    os.utime(folder / f"gateway.{name}", (time.time() - seconds,) * 2)


def look(folder, *words: str) -> None:
    assert probe("gateway", *words, GEMELO_PATHS_RUN=str(folder)).returncode == 1


def stand_still(process: subprocess.Popen[bytes], folder) -> None:
    """Long enough to be ended at the second look, which is 3 s after the first."""
    process.send_signal(signal.SIGSTOP)
    assert until(lambda: "T" in status(process)), status(process)
    age(folder, "alive", 9.0)
    look(folder, "restart")
    age(folder, "still", 3.0)


def status(process: subprocess.Popen[bytes]) -> str:
    with open(f"/proc/{process.pid}/stat") as file:
        return file.read().rpartition(")")[2].split()[0]


def test_who_stands_still_is_ended_at_the_second_look(tmp_path, beating):
    stand_still(beating, tmp_path)
    said = probe("gateway", "restart", GEMELO_PATHS_RUN=str(tmp_path))
    assert (said.returncode, "gateway stood still" in said.stdout) == (1, True)
    assert beating.wait(60.0) == -signal.SIGKILL


def test_who_is_not_ready_and_goes_on_is_never_ended(tmp_path, beating):
    """Nor one that stood still once, was seen so, and has gone on since, as after a laptop's sleep."""
    for _ in range(2):
        (tmp_path / "gateway.still").unlink(missing_ok=True)  # here all is older than it would be
        beating.send_signal(signal.SIGSTOP)
        age(tmp_path, "alive", 9.0)
        look(tmp_path, "restart")
        assert (tmp_path / "gateway.still").exists()
        beating.send_signal(signal.SIGCONT)
        assert until(lambda: time.time() - (tmp_path / "gateway.alive").stat().st_mtime < 1.0)
        age(tmp_path, "still", 3.0)
        look(tmp_path, "restart")
    assert beating.poll() is None


def test_a_look_for_readiness_alone_ends_nobody(tmp_path, beating):
    stand_still(beating, tmp_path)
    look(tmp_path)
    assert beating.poll() is None


def test_another_process_that_has_the_number_now_is_not_ended(tmp_path, beating):
    stand_still(beating, tmp_path)
    pid, started = (tmp_path / "gateway.alive").read_text().split()
    (tmp_path / "gateway.alive").write_text(f"{pid} {int(started) - 1}\n")
    age(tmp_path, "alive", 9.0)
    look(tmp_path, "restart")
    assert beating.poll() is None


def test_who_starts_anew_is_not_judged_by_the_beats_of_its_former_self(tmp_path):
    (tmp_path / "planner.alive").write_text("1 1\n")
    Readiness(tmp_path, "planner", UnwrittenFiles(print))
    assert not (tmp_path / "planner.alive").exists()
