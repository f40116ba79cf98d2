"""Services as processes: clean stops, exit codes, waiting for the router, and no hanging exit."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.priority import BEHIND
from gemelo.schemas.topics import JOINT_STATES
from tests.real_time import may_run_in_real_time
from tests.runtime.support import ROOT, RouterProcess, programs, until

PROMPT = 6.0  # [s] within which every process ends after SIGTERM

HEAD = """
import sys, time
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES, LOG
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.node import Node
"""

Start = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(router: RouterProcess, tmp_path: Path) -> Iterator[Start]:
    numbers = itertools.count()
    with programs(router) as run:

        def start_program(text: str, *arguments: str, **environ: str) -> subprocess.Popen[str]:
            file = tmp_path / f"program_{next(numbers)}.py"
            file.write_text(HEAD + textwrap.dedent(text), encoding="utf-8")
            return run(str(file), *arguments, **environ)

        yield start_program


def await_line(process: subprocess.Popen[str], wanted: str) -> None:
    assert process.stdout is not None
    assert process.stdout.readline().strip() == wanted


def end(process: subprocess.Popen[str], number: int = signal.SIGTERM) -> tuple[int, str]:
    begin = time.monotonic()
    process.send_signal(number)
    _, errors = process.communicate(timeout=60.0)
    assert time.monotonic() - begin < PROMPT
    return process.returncode, errors


SPINNER = """
def run(node, deployment):
    node.subscribe(LOG, lambda message: None)
    latest = node.latest(JOINT_STATES)
    publisher = node.publisher(JOINT_STATES)
    node.set_ready(True)
    print("spins", flush=True)
    node.spin(lambda now: publisher.put(JointState(stamp=now)), rate=50.0)
    print("after the spin", flush=True)

service("spinner", run)
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_service_stops_cleanly(start: Start, router: RouterProcess, number: int) -> None:
    process = start(SPINNER)
    await_line(process, "spins")
    ready = router.folder / "run" / "spinner.ready"
    assert until(ready.exists)
    code, errors = end(process, number)
    assert code == 0
    assert not ready.exists()
    assert "Traceback" not in errors


def test_a_service_stops_cleanly_while_the_router_is_dead(start: Start, tmp_path: Path) -> None:
    own = RouterProcess(tmp_path)
    process = start(SPINNER, GEMELO_ROUTER_PORT=str(own.port))
    await_line(process, "spins")
    own.kill()
    time.sleep(0.5)
    code, errors = end(process)
    assert (code, "Traceback" in errors) == (0, False)


def test_a_service_that_waits_for_the_router_says_so_and_can_be_stopped(start: Start, tmp_path: Path) -> None:
    own = RouterProcess(tmp_path)
    own.kill()
    process = start(SPINNER, GEMELO_ROUTER_PORT=str(own.port))
    assert process.stderr is not None
    line = process.stderr.readline()
    assert f"spinner WARNING waiting for the router at 127.0.0.1:{own.port}: start the twin with `make up`" in line
    code, errors = end(process)
    assert (code, errors) == (0, "")


def test_a_service_starts_when_the_router_comes(start: Start, tmp_path: Path) -> None:
    own = RouterProcess(tmp_path)
    own.kill()
    process = start(SPINNER, GEMELO_ROUTER_PORT=str(own.port))
    time.sleep(0.5)
    own.start()
    await_line(process, "spins")
    assert end(process)[0] == 0
    assert own.stop() == 0


def test_a_callback_that_never_returns_does_not_keep_the_process(start: Start) -> None:
    process = start(
        """
        def step(now):
            print("stuck", flush=True)
            while True:
                time.sleep(1.0)

        service("stuck", lambda node, deployment: node.spin(step))
        """
    )
    await_line(process, "stuck")
    code, errors = end(process)
    assert code == 1
    assert "did not stop within" in errors
    assert "in step" in errors


def test_a_service_that_needs_longer_to_end_gets_its_own_time(start: Start) -> None:
    process = start(
        """
        def run(node, deployment):
            print("spins", flush=True)
            node.spin()
            time.sleep(2.5)  # what it has to write takes as long

        service("writer", run, grace=4.0)
        """
    )
    await_line(process, "spins")
    assert end(process) == (0, "")


@pytest.mark.parametrize("full", [True, False], ids=["a full disk", "nobody reads"])
def test_words_that_nobody_takes_end_no_service(start: Start, tmp_path: Path, full: bool) -> None:
    """Its log goes to a disk that is full, or into a pipe whose reader has gone."""
    process = start(
        f"""
        import os
        def run(node, deployment):
            print("spins", flush=True)
            out = os.open("/dev/full", os.O_WRONLY) if {full} else os.pipe()[1]
            for number in (1, 2):
                os.dup2(out, number)
            node.set_ready(True)
            count = 0

            def step(now):
                nonlocal count
                count += 1
                node.log.warning("word %d", count)
                if count == 50:
                    open({str(tmp_path / "done")!r}, "w").close()

            node.spin(step)

        service("talker", run)
        """
    )
    await_line(process, "spins")
    assert until((tmp_path / "done").exists, 20.0)
    assert end(process)[0] == 0


def test_what_a_thread_still_holds_at_the_end_is_not_called_a_leak(start: Start) -> None:
    """A thread of Zenoh or of an open link that has not ended in time has the gateway's generator of ruckig's."""
    process = start(
        """
        import threading
        from ruckig import Ruckig

        def run(node, deployment):
            threading.Thread(target=lambda held: time.sleep(60), args=(Ruckig(6, 0.01),), daemon=True).start()
            print("spins", flush=True)
            node.spin()

        service("held", run)
        """
    )
    await_line(process, "spins")
    assert end(process) == (0, "")


def test_a_step_that_raises_ends_the_process_with_one_report(start: Start) -> None:
    process = start(
        """
        def fail(now):
            raise ZeroDivisionError("oh")

        service("failing", lambda node, deployment: node.spin(fail))
        """
    )
    _, errors = process.communicate(timeout=PROMPT)
    assert process.returncode == 1
    assert "failing ERROR ended by an error" in errors
    assert errors.count("ZeroDivisionError: oh") == 1


def test_a_callback_that_raises_is_reported_and_the_service_goes_on(start: Start, router: RouterProcess) -> None:
    process = start(
        """
        def fail(message):
            print("called", message.stamp, flush=True)
            if message.stamp == 3:
                node_.stop()
            raise ZeroDivisionError("oh")

        def run(node, deployment):
            global node_
            node_ = node
            node.subscribe(JOINT_STATES, fail)
            print("spins", flush=True)
            node.spin()

        service("failing", run)
        """
    )
    await_line(process, "spins")
    with Node("writer", router.deployment, robot="rm1") as writer:
        for stamp in (1, 2, 3):
            writer.publisher(JOINT_STATES).put(JOINT_STATES.message(stamp=stamp))
            await_line(process, f"called {stamp}")
        _, errors = process.communicate(timeout=PROMPT)
    assert process.returncode == 0
    assert "failing ERROR a handler failed; what it was given is lost, and the service goes on" in errors
    assert errors.count("ZeroDivisionError: oh") == 1


def test_a_thread_that_a_library_left_behind_does_not_keep_the_process(start: Start) -> None:
    process = start(
        """
        import threading

        def run(node, deployment):
            threading.Thread(target=time.sleep, args=(60,)).start()

        service("threads", run)
        """
    )
    process.communicate(timeout=PROMPT)
    assert process.returncode == 0


def test_a_thread_that_dies_ends_the_process_with_its_name_and_where(start: Start) -> None:
    """As one that reads a wire: what goes on without it looks well and hears nothing."""
    process = start(
        """
        import threading

        def read():
            [][1]

        def run(node, deployment):
            threading.Thread(target=read, name="wire", daemon=True).start()
            node.spin()

        service("reading", run)
        """
    )
    _, errors = process.communicate(timeout=PROMPT)
    assert process.returncode == 1
    assert 'reading ERROR the thread "wire" has died, and with it this process' in errors
    assert "IndexError" in errors


def test_an_error_before_the_spin_ends_the_process(start: Start) -> None:
    process = start("service('failing', lambda node, deployment: {}['no such key'])")
    _, errors = process.communicate(timeout=PROMPT)
    assert process.returncode == 1
    assert "KeyError" in errors


def test_a_script_that_forgets_to_close_its_node_ends_all_the_same(start: Start) -> None:
    process = start(
        """
        node = Node("forgetful")
        node.subscribe(JOINT_STATES, print)
        node.wait(0.1)
        """
    )
    _, errors = process.communicate(timeout=PROMPT + 1.0)
    assert (process.returncode, errors) == (0, "")


def test_a_name_that_is_taken_and_parameters_that_do_not_exist_are_one_sentence(start: Start) -> None:
    first = start(SPINNER)
    await_line(first, "spins")
    second = start(SPINNER)
    _, errors = second.communicate(timeout=PROMPT + 2.0)
    assert second.returncode == 1
    assert f'another node named "spinner" is alive (process {first.pid} on' in errors
    assert len(errors.splitlines()) == 1
    program = """
        import msgspec

        class Own(msgspec.Struct, frozen=True):
            lead: float = 0.3

        def run(node, deployment):
            print(node.parameters(Own).value.lead, flush=True)

        service("own", run)
        """
    good = start(program, "--set", "lead=0.5")
    assert good.communicate(timeout=PROMPT)[0] == "0.5\n"
    assert good.returncode == 0
    bad = start(program, "--set", "leda=0.5")
    _, errors = bad.communicate(timeout=PROMPT)
    assert bad.returncode == 1
    assert 'own has no parameter "leda": did you mean "lead"?' in errors


def test_a_killed_node_can_be_started_again_at_once(start: Start) -> None:
    first = start(SPINNER)
    await_line(first, "spins")
    first.kill()
    first.wait()
    second = start(SPINNER)
    await_line(second, "spins")
    assert end(second)[0] == 0


def test_a_process_that_goes_on_beside_its_successor_ends_with_a_sentence(start: Start) -> None:
    """Stopped for longer than its lease it counts as dead, and another is started in its place."""
    first = start(SPINNER)
    await_line(first, "spins")
    first.send_signal(signal.SIGSTOP)
    second = start(SPINNER)
    await_line(second, "spins")
    first.send_signal(signal.SIGCONT)
    _, errors = first.communicate(timeout=60.0)
    assert first.returncode == 1
    assert f'another node named "spinner" has started since this one (process {second.pid} on ' in errors
    assert "Traceback" not in errors
    assert end(second)[0] == 0


def test_the_router_stops_cleanly_and_says_when_its_port_is_taken(tmp_path: Path) -> None:
    own = RouterProcess(tmp_path)
    ready = tmp_path / "run" / "router.ready"
    assert until(ready.exists)
    command = [sys.executable, "-m", "gemelo.services.router.main"]
    second = subprocess.run(command, cwd=ROOT, env=own.environ, capture_output=True, text=True, timeout=5.0)
    assert second.returncode == 1
    assert f"port {own.port} on 127.0.0.1 is taken by " in second.stderr
    assert "GEMELO_ROUTER_PORT" in second.stderr
    assert ready.exists()
    assert own.stop() == 0
    assert not ready.exists()


def test_an_idle_node_at_50_hz_needs_little(start: Start) -> None:
    import psutil

    process = start(SPINNER)
    await_line(process, "spins")
    observed = psutil.Process(process.pid)
    time.sleep(0.5)
    before, begin = sum(observed.cpu_times()[:2]), time.monotonic()
    time.sleep(2.0)
    share = (sum(observed.cpu_times()[:2]) - before) / (time.monotonic() - begin)
    assert share < 0.05
    assert end(process)[0] == 0


def test_importing_the_node_is_fast_and_light() -> None:
    program = "import gemelo.libraries.runtime.node, sys; print('zenoh' in sys.modules, 'numpy' in sys.modules)"
    begin = time.monotonic()
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=10.0)
    assert done.stdout == "False False\n", done.stderr
    assert time.monotonic() - begin < 8.0


@pytest.mark.parametrize(("before", "after"), [(0, BEHIND), (BEHIND + 4, BEHIND + 4)])
def test_what_may_wait_steps_behind_and_never_ahead(before: int, after: int) -> None:
    asked = max(0, before - os.nice(0))
    module = "gemelo.libraries.runtime.process.priority"
    code = f"import os; from {module} import lower_priority; lower_priority(); print(os.nice(0))"
    command = [sys.executable, "-c", f"import os; os.nice({asked}); {code}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert int(done.stdout) == max(after, os.nice(0))


def test_every_thread_of_what_steps_ahead_has_a_real_time_priority_where_the_system_allows_it() -> None:
    program = """
import os, threading
from gemelo.libraries.runtime.process.priority import AHEAD, raise_priority
before = threading.Thread(target=threading.Event().wait, daemon=True)
before.start()
has = raise_priority()
threading.Thread(target=threading.Event().wait, daemon=True).start()
threads = [int(each) for each in os.listdir("/proc/self/task")]
policies = {(os.sched_getscheduler(each), os.sched_getparam(each).sched_priority) for each in threads}
print(len(threads), has, policies == {(os.SCHED_RR, AHEAD)}, policies == {(os.SCHED_OTHER, 0)})
"""
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    may = may_run_in_real_time()
    assert done.stdout.split() == ["3", str(may), str(may), str(not may)]
