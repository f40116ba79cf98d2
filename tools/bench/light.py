"""Figures of what the whole default stack costs a small computer: CPU at rest and in motion, and memory."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from threading import Event, Thread

import psutil

import gemelo
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples, rounded
from gemelo.tools.bench.stack import Stacks, cpu_seconds, families
from gemelo.tools.stack.stack import PROCESSES, Stack

IDLE_GOAL = FigureGoal(median=12.0)  # [% of one core]
MOVING_GOAL = FigureGoal(median=30.0)  # [% of one core]
MEMORY_GOAL = FigureGoal(median=400.0)  # [MB]
SETTLE, WINDOW, WINDOWS = 15.0, 4.0, 5  # [s], [s]; chosen: the input log waits 10 s for a recorder
SERVER, PROBES = "process-compose", "readiness probes"  # the second are children of the first that have ended
WHERE = "a viewer, no browser"


def idle_cpu_percent(stacks: Stacks) -> Figure:
    """CPU time [% of one core] of all processes while the arm stands and nobody looks."""
    with _whole(stacks) as stack:
        return _cpu(stack, IDLE_GOAL)


def moving_cpu_percent(stacks: Stacks) -> Figure:
    """CPU time [% of one core] of all processes while the arm goes to and fro."""
    with _whole(stacks) as stack, _moving(stack):
        return _cpu(stack, MOVING_GOAL)


def idle_pss_mb(stacks: Stacks) -> Figure:
    """Memory [MB] of all processes at rest, a page that several share counted in parts (PSS)."""
    with _whole(stacks) as stack:
        time.sleep(SETTLE)
        sizes = {name: sum(map(_pss, family)) for name, family in _families(stack).items()}
    return of_samples([sum(sizes.values())], MEMORY_GOAL, note=f"{WHERE}: {_by_size(sizes)}")


@contextmanager
def _whole(stacks: Stacks) -> Iterator[Stack]:
    """What `make up` starts."""
    stacks.stop()
    with Stack(viewer="web", panel=True, processes=PROCESSES) as stack:
        yield stack


@contextmanager
def _moving(stack: Stack) -> Iterator[None]:
    """The arm goes between two places until this is left; raises what a move refuses."""
    deployment, is_over = load_deployment(None, stack.environment), Event()
    arm = gemelo.connect(gemelo.Robot(deployment, load_arm(project_root() / deployment.robot)))
    failed: list[Exception] = []

    def go() -> None:
        try:
            while not is_over.is_set():
                arm.move(named="ready")
                arm.move(named="home")
        except gemelo.Error as error:
            failed.append(error)

    mover = Thread(target=go, daemon=True)
    try:
        if not all(arm.device.state.referenced):
            arm.reference()
        mover.start()
        yield
    finally:
        is_over.set()
        mover.join(60.0)
        arm.close()
    if failed:
        raise failed[0]


def _cpu(stack: Stack, goal: FigureGoal) -> Figure:
    time.sleep(SETTLE)
    found = _families(stack)
    marks = [_used(found)]
    for _ in range(WINDOWS):
        time.sleep(WINDOW)
        marks.append(_used(found))
    samples = [_share(one, other, sum(one[1].values()), sum(other[1].values())) for one, other in pairwise(marks)]
    shares = {name: _share(marks[0], marks[-1], marks[0][1][name], marks[-1][1][name]) for name in marks[0][1]}
    note = f"{len(found)} processes, {WHERE}, {WINDOWS} windows of {WINDOW:g} s: {_by_size(shares)}"
    return of_samples(samples, goal, note=note)


Mark = tuple[float, dict[str, float]]  # [s] monotonic, and [s] of CPU by process


def _used(found: dict[str, list[psutil.Process]]) -> Mark:
    used = {name: cpu_seconds(family) for name, family in found.items()}
    (server,) = found[SERVER]
    times = server.cpu_times()
    return time.monotonic(), {**used, PROBES: times.children_user + times.children_system}


def _share(one: Mark, other: Mark, before: float, after: float) -> float:
    """[% of one core] between two marks."""
    return 100.0 * (after - before) / (other[0] - one[0])


def _families(stack: Stack) -> dict[str, list[psutil.Process]]:
    """By name, process-compose too."""
    assert stack.server is not None
    return {**families(stack), SERVER: [psutil.Process(stack.server.pid)]}


def _pss(process: psutil.Process) -> float:
    """[MB]"""
    return float(process.memory_full_info().pss) / 1e6


def _by_size(values: dict[str, float]) -> str:
    return ", ".join(f"{name} {rounded(value):g}" for name, value in sorted(values.items(), key=lambda item: -item[1]))
