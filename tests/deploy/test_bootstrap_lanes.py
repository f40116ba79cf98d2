"""`deploy/bootstrap` runs what it can side by side: how it tells, fails and is ended."""

from __future__ import annotations

import os
import signal
import subprocess
import time

import pytest

from tests.deploy.conftest import GO

STEPS = ("packages", "core", "go")
MEETS = """#!/bin/sh
# Succeeds only if the other two run at the same time.
touch "$HOME/{name}"
tries=0
until [ -e "$HOME/packages" ] && [ -e "$HOME/core" ] && [ -e "$HOME/go" ]; do
    tries=$((tries + 1))
    [ $tries -lt 400 ] || exit 1
    sleep 0.05
done
"""
STAYS = """#!/bin/sh
sleep 120 &
echo $$ $! > "$HOME/{name}.new"
mv "$HOME/{name}.new" "$HOME/{name}"
wait
"""
UV_MADE = 'mkdir -p .venv/bin; ln -sf "$(command -v python3)" .venv/bin/python; touch .venv/bin/gemelo\n'


def give_steps(machine, text):
    """The three steps that need nothing of one another, each as `text` with its name."""
    machine.complete()
    (machine.bin / "process-compose").unlink()
    machine.program("uv", text.format(name="packages") + UV_MADE)
    machine.program("go", GO.format(body=text.format(name="go")))
    core = machine.root / "firmware/bindings/build.sh"
    machine.write(core, text.format(name="core") + core.read_text())


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def wait_until(condition, what):
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, f"waited 60 s for {what}"
        time.sleep(0.02)


def test_packages_firmware_core_and_process_compose_are_made_side_by_side(machine):
    give_steps(machine, MEETS)
    done = machine.bootstrap()
    assert done.returncode == 0, done.stderr
    assert "ready." in done.stdout


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_an_interrupt_ends_every_step_and_what_it_has_started(machine, number, code):
    give_steps(machine, STAYS)
    with machine.begin() as bootstrap:
        try:
            wait_until(lambda: all((machine.home / name).exists() for name in STEPS), "all three steps")
            begun = [int(pid) for name in STEPS for pid in (machine.home / name).read_text().split()]
            assert len(begun) == 6
            assert all(is_alive(pid) for pid in begun)
            bootstrap.send_signal(number)
            _, said = bootstrap.communicate(timeout=60.0)
        finally:
            bootstrap.kill()
    assert bootstrap.returncode == code
    assert "interrupted" in said
    wait_until(lambda: not any(is_alive(pid) for pid in begun), "the steps to be gone")


@pytest.mark.full
def test_a_step_that_does_not_end_when_it_is_told_is_killed(machine):
    give_steps(machine, STAYS.replace("sleep 120 &", "trap '' TERM\nsleep 120 &"))
    with machine.begin() as bootstrap:
        try:
            wait_until(lambda: all((machine.home / name).exists() for name in STEPS), "all three steps")
            begun = [int(pid) for name in STEPS for pid in (machine.home / name).read_text().split()]
            bootstrap.send_signal(signal.SIGINT)
            _, said = bootstrap.communicate(timeout=60.0)
        finally:
            bootstrap.kill()
    assert bootstrap.returncode == 130
    assert "interrupted" in said
    wait_until(lambda: not any(is_alive(pid) for pid in begun), "the steps to be gone")


def test_a_failing_step_shows_its_own_output_and_leaves_the_others_to_finish(machine):
    machine.complete()
    machine.write(machine.root / "firmware/bindings/build.sh", "echo core.cpp:1: error: no such type >&2; exit 1")
    failed = machine.bootstrap()
    assert failed.returncode == 1
    assert "core.cpp:1: error: no such type" in failed.stderr
    assert "the firmware core did not compile" in failed.stderr
    assert "a C++17 compiler is needed: sudo apt-get install g++" in failed.stderr
    again = machine.bootstrap()
    assert "==> the firmware core" in again.stdout
    assert "Python packages" not in again.stdout


def test_a_command_that_fails_without_a_remedy_of_its_own_names_its_step_and_shows_its_output(machine):
    machine.complete()
    machine.program("uv", '#!/bin/sh\nmkdir -p .venv/bin\n[ "$1" != venv ] || { echo no space left >&2; exit 1; }\n')
    failed = machine.bootstrap()
    assert failed.returncode == 1
    assert "no space left" in failed.stderr
    assert "Python packages of requirements.lock into .venv: failed" in failed.stderr


def test_everything_that_is_missing_is_named_at_once(machine):
    machine.complete()
    for name in ("c++", "go", "process-compose"):
        (machine.bin / name).unlink()
    machine.program("uv", "#!/bin/sh\ncase \"$*\" in *'/python3 .venv') mkdir -p .venv/bin ;; *) exit 1 ;; esac\n")
    failed = machine.bootstrap()
    assert failed.returncode == 1
    for remedy in ("sudo apt-get install g++", "UV_DEFAULT_INDEX", "install Go 1.24 or newer"):
        assert remedy in failed.stderr


def test_words_that_two_steps_have_in_common_are_said_once(machine):
    machine.complete()
    (machine.bin / "c++").unlink()
    failed = machine.bootstrap()
    assert "the firmware core for Python (firmware/bindings): FAILED" in failed.stdout
    assert "the motion core of the planner (services/planner/native): FAILED" in failed.stdout
    assert failed.stderr.count("there is no C++ compiler") == 1


def test_a_word_that_comes_in_two_pieces_is_one(pytestconfig):
    """On a busy machine the look that ends each second may fall into the middle of a line."""
    script = """
        set -euo pipefail
        bold='' plain='' red='' logs=$(mktemp -d) say=''
        say() { printf '%s\\n' "$1"; }
        source deploy/lanes.sh
        exec {told}< <(printf 'begin core the fir'; sleep 1.5; printf 'mware core\\ndo'; sleep 1.5
                       printf 'ne core 7\\nend \\n'; sleep 0.5)
        sleep 4 & lanes=($!)
        await_lanes
    """
    done = subprocess.run(
        ["bash", "-c", script], cwd=pytestconfig.rootpath, capture_output=True, text=True, timeout=30.0
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["==> the firmware core", "    the firmware core: done in 7 s"]
