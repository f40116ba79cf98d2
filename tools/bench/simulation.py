"""Figures of a twin inside one process: how much faster than real it is, and how soon it is there."""

from __future__ import annotations

import time

import gemelo
from gemelo.tools.bench.figures import Figure, FigureGoal, of_samples

ROUNDS = 12
TOUR = ("ready", "left", "right", "home")  # named states of rm1
LEAST_SPEED, MOST_START = 50.0, 500.0  # [s/s], [ms]


def simulate_speed() -> Figure:
    """Virtual seconds in a real one [s/s] of a tour that is planned, checked, played by the firmware and verified."""
    samples, rest, virtual = [], [], 0.0
    with gemelo.simulate("rm1") as arm:
        arm.move(named=TOUR[0])
        for _ in range(ROUNDS):
            began, then = time.perf_counter(), arm.sim.now
            for name in TOUR:
                arm.move(named=name)
            samples.append((arm.sim.now - then) / (time.perf_counter() - began))
            virtual += arm.sim.now - then
            began = time.perf_counter()
            arm.sim.sleep(2.0)
            rest.append(2.0 / (time.perf_counter() - began))
    note = f"{ROUNDS} tours of {len(TOUR)} planned moves of rm1, {virtual:.0f} s in all; the slowest {min(samples):.3g}"
    reference = {"at rest": sorted(rest)[len(rest) // 2], "of the processor time": _by_processor_time()}
    return of_samples(samples, FigureGoal(least=LEAST_SPEED), reference, note)


def _by_processor_time() -> float:
    """Virtual seconds in one of this process's processor time [s/s], which other processes take nothing of."""
    with gemelo.simulate("rm1") as arm:
        arm.move(named=TOUR[0])
        began, then = time.process_time(), arm.sim.now
        for name in TOUR:
            arm.move(named=name)
        return (arm.sim.now - then) / (time.process_time() - began)


def simulate_start_ms() -> Figure:
    """[ms] from `gemelo.simulate("rm1")` to an arm that moves, in a process that has begun one before."""
    samples = []
    for _ in range(ROUNDS + 1):
        began = time.perf_counter()
        with gemelo.simulate("rm1"):
            samples.append(1e3 * (time.perf_counter() - began))
    first, *others = samples
    note = "with drivers that hold and a planner that is prepared; the first of a process loads the planner's libraries"
    return of_samples(others, FigureGoal(median=MOST_START), {"the first of a process": first}, note)
