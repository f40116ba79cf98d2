"""Running stacks, shared by several figures, and the figures of how long a start takes."""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass

import psutil

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples
from gemelo.tools.stack.stack import Stack

READY_GOAL = FigureGoal(median=8.0)  # [s]
READY_ROUNDS = 3
CLI_GOAL = FigureGoal(p99=500.0)  # [ms]
CLI_ROUNDS = 15
IMPORT_GOAL = FigureGoal(median=120.0)  # [ms]
CPUCLOCK_SCHED = 2  # the kernel's include/linux/posix-timers.h: with ~pid above it, the CPU clock of a whole process
GEMELO = (sys.executable, "-m", "gemelo.tools.cli.main")


@dataclass(frozen=True)
class Running:
    """A stack that is ready, and a node of the bench on its bus."""

    stack: Stack
    deployment: Deployment
    arm: ArmDescription
    node: Node


class Stacks:
    """Starts a stack for each broker when first asked for; stops all of them at the end."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._running: dict[str, Running] = {}

    def __enter__(self) -> Stacks:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Stops everything that runs; the next figure starts a new stack."""
        self._running.clear()
        self._open.close()

    def with_broker(self, broker: str, locked_for: str = "") -> Running:
        """The stack with this MQTT broker; stops any other, because two would disturb each other.

        With TLS, users and an ACL where `locked_for` names its device. Raises NotMeasured if mosquitto is asked for and
        not installed.
        """
        if broker == "mosquitto" and not has_mosquitto():
            raise NotMeasured("mosquitto is not installed: apt-get install mosquitto")
        key = f"{broker} {locked_for}"
        if key not in self._running:
            self.stop()
            self._running[key] = self._start(broker, locked_for)
        return self._running[key]

    def any_broker(self) -> Running:
        """The stack that runs, else a new one."""
        for running in self._running.values():
            return running
        return self.with_broker("mosquitto" if has_mosquitto() else "embedded")

    def _start(self, broker: str, locked_for: str) -> Running:
        stack = self._open.enter_context(Stack(broker=broker, locked_for=locked_for, viewer="none"))
        deployment = load_deployment(None, stack.environment)
        arm = load_arm(project_root() / deployment.robot)
        node = self._open.enter_context(Node("bench", deployment, robot=arm.name))
        return Running(stack, deployment, arm, node)


def has_mosquitto() -> bool:
    """True if mosquitto is installed, also in /usr/sbin, which Debian leaves out of a user's PATH."""
    return any(shutil.which("mosquitto", path=path) for path in (None, "/usr/sbin", "/usr/local/sbin"))


def families(stack: Stack) -> dict[str, list[psutil.Process]]:
    """Every process with its children, by its name in process-compose.yaml."""
    found = {}
    for name, pid in sorted(stack.pids().items()):
        process = psutil.Process(pid)
        found[name] = [process, *process.children(recursive=True)]
    return found


def cpu_seconds(processes: list[psutil.Process]) -> float:
    """CPU time [s] that the processes have used so far, to the nanosecond: /proc tells only whole ticks of 10 ms."""
    return sum(time.clock_gettime(~process.pid << 3 | CPUCLOCK_SCHED) for process in processes)


def rss_mb(processes: list[psutil.Process]) -> float:
    """Resident memory [MB]; shared pages are counted for each process."""
    return sum(float(process.memory_info().rss) for process in processes) / 1e6


def ready_s(stacks: Stacks) -> Figure:
    """Time [s] of a second `make up`: a bootstrap with everything done, and every process ready."""
    stacks.stop()
    samples, skipping = [], []
    bootstrap()  # leaves nothing to do for the rounds
    for _ in range(READY_ROUNDS):
        skipping.append(bootstrap())
        with Stack(viewer="none") as stack:
            samples.append(skipping[-1] + stack.ready_seconds)
            count = len(stack.processes)
    note = (
        f"deploy/bootstrap with everything done ({min(skipping):.2f} s), then {count} processes with the embedded "
        "broker, no viewer"
    )
    return of_samples(samples, READY_GOAL, note=note)


def bootstrap() -> float:
    """Time [s] of deploy/bootstrap; raises NotMeasured if it fails."""
    started = time.monotonic()
    done = subprocess.run(["deploy/bootstrap"], cwd=project_root(), capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasured(f"deploy/bootstrap failed: {(done.stderr or done.stdout)[-300:]}")
    return time.monotonic() - started


def cli_start_ms() -> Figure:
    """Time [ms] to the first output of `gemelo topic list` or `gemelo --help`, the later one in each round."""
    samples, helps, bare = [], [], []
    for _ in range(CLI_ROUNDS):
        listing = first_output(*GEMELO, "topic", "list")
        help_ = first_output(*GEMELO, "--help")
        samples.append(max(listing, help_))
        helps.append(help_)
        bare.append(first_output(sys.executable, "-c", "print()"))
    reference = {"python -c 'print()'": statistics.median(bare), "gemelo --help": statistics.median(helps)}
    return of_samples(samples, CLI_GOAL, reference, f"gemelo topic list, {CLI_ROUNDS} starts")


def import_gemelo_ms() -> Figure:
    """Time [ms] from the start of Python to its first output after `from gemelo import connect`, as a script begins."""
    programs = {
        "import gemelo": "import gemelo",
        "import msgspec, zenoh": "import msgspec, zenoh",
        "python -c 'print()'": "",
        "": "from gemelo import connect",
    }
    python = ("env", "-u", "PYTHONDONTWRITEBYTECODE", sys.executable, "-c")  # its second start reads bytecode
    first_output(*python, f"{programs['']}\nprint()")
    samples: dict[str, list[float]] = {name: [] for name in programs}
    for _ in range(CLI_ROUNDS):
        for name, program in programs.items():
            samples[name].append(first_output(*python, f"{program}\nprint()"))
    own = samples.pop("")
    reference = {name: statistics.median(times) for name, times in samples.items()}
    return of_samples(own, IMPORT_GOAL, reference, f"from gemelo import connect, {CLI_ROUNDS} starts")


def first_output(*command: str) -> float:
    """Time [ms] from starting `command` to its first byte of output."""
    started = time.perf_counter()
    with subprocess.Popen(command, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.read(1)
        took = (time.perf_counter() - started) * 1e3
        process.stdout.read()
    return took
