"""Figures of single collision checks: one configuration, and configurations along straight joint paths."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.collision.sphere_check import native_scene
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile
from gemelo.tools.bench.planner.references import CoalChecker
from gemelo.tools.bench.scenes import CHECK_SCENE, parol6, random_configurations, rm1

if TYPE_CHECKING:
    from gemelo.services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]
Question = TypeVar("Question")

BATCH, BATCHES = 1000, 40
ONE_BY_ONE = 2000
TEN = 10  # calls timed as one: reading the CPU clock takes as long as part of one call
PATHS, POINTS = 300, 200
COAL_PATHS = 30  # of them for coal


def state_check_us() -> Figure:
    """CPU time of one configuration [us], self and scene: the motion core in batches, against pinocchio and coal."""
    arm = parol6()
    core = loaded_core(arm)
    rows = random_configurations(arm, BATCH * BATCHES)
    samples = []
    for batch in np.array_split(rows, BATCHES):
        started = time.thread_time()
        core.free(batch)
        samples.append((time.thread_time() - started) / BATCH * 1e6)
    reference = {
        "pinocchio + coal, same scene": coal_us(arm),
        "gemelo.libraries.arm.kinematics, self only": self_us(arm),
        "motion core, one configuration a call": single_us(core, rows),
        "rm1, motion core": batch_us(rm1()),
        "rm1, pinocchio + coal, same scene": coal_us(rm1()),
    }
    note = (
        f"parol6, {core.sphere_count} spheres, {len(CHECK_SCENE.objects)} boxes, batches of {BATCH} random "
        f"configurations within the limits, {core.kernel}, CPU time"
    )
    return of_samples(samples, None, reference, note)


def loaded_core(arm: ArmDescription, kernel: str | None = None) -> NativePlanner:
    """A motion core with the check scene, its best kernel if none is named; raises NotMeasured if not compiled."""
    try:
        from gemelo.services.planner.native.native_planner import NativePlanner  # fails where it is not compiled
    except ImportError as error:
        raise NotMeasured(str(error)) from error
    core = NativePlanner(arm) if kernel is None else NativePlanner(arm, kernel=kernel)
    core.set_scene(native_scene(arm, CHECK_SCENE)[0])
    return core


def batch_us(arm: ArmDescription) -> float:
    """Median time [us] of a configuration in a batch, with the motion core."""
    core = loaded_core(arm)
    return median_us(core.free, np.array_split(random_configurations(arm, BATCH * BATCHES), BATCHES)) / BATCH


def single_us(core: NativePlanner, rows: Array) -> float:
    """Median time [us] of one configuration of `rows` (m, n) [rad] or [m], the call from Python included."""
    each = [row[None, :] for row in rows[:ONE_BY_ONE]]
    tens = [each[first : first + TEN] for first in range(0, ONE_BY_ONE, TEN)]
    return median_us(lambda some: [core.free(row) for row in some], tens) / TEN


def coal_us(arm: ArmDescription) -> float:
    """Median time [us] of one configuration with pinocchio and coal."""
    return median_us(CoalChecker(arm, CHECK_SCENE).is_free, random_configurations(arm, ONE_BY_ONE))


def self_us(arm: ArmDescription) -> float:
    """Median time [us] of the distances between the links at one configuration, without a scene."""
    return median_us(Kinematics(arm).collisions.distance, random_configurations(arm, ONE_BY_ONE))


def median_us(ask: Callable[[Question], object], questions: Iterable[Question]) -> float:
    """Median CPU time [us] of one call."""
    samples = []
    for question in questions:
        started = time.thread_time()
        ask(question)
        samples.append((time.thread_time() - started) * 1e6)
    return quantile(samples, 0.5)


def collision_checks_per_s() -> Figure:
    """Configurations checked per second of CPU time along straight joint paths, self and scene, on one core."""
    arm = parol6()
    loaded_core(arm)  # says where it is not compiled
    from gemelo.services.planner.native.binding import motion  # fails where it is not compiled

    paths = straight_paths(random_configurations(arm, 2 * PATHS))
    samples = {name: check_rates(loaded_core(arm, name).free, paths) for name in motion.kernel_names()}
    best = motion.kernel_names()[0]
    reference = {name: quantile(rate, 0.5) for name, rate in samples.items() if name != best}
    checker = CoalChecker(arm, CHECK_SCENE)
    coal_rates = check_rates(lambda path: [checker.is_free(row) for row in path], paths[:COAL_PATHS])
    reference["pinocchio + coal"] = quantile(coal_rates, 0.5)
    note = (
        f"parol6, {len(CHECK_SCENE.objects)} boxes, {best}, {PATHS} lines of {POINTS} configurations; p99 is the "
        "fastest; CPU time"
    )
    return of_samples(samples[best], None, reference, note)


def straight_paths(rows: Array) -> list[Array]:
    """Paths of (POINTS, n) configurations [rad] or [m], each between two consecutive ones of `rows` (2 m, n)."""
    shares = np.linspace(0.0, 1.0, POINTS)[:, None]
    return [start + shares * (goal - start) for start, goal in zip(rows[::2], rows[1::2], strict=True)]


def check_rates(check: Callable[[Array], object], paths: list[Array]) -> list[float]:
    """Configurations per second of CPU time [1/s], for each path (m, n) [rad] or [m]."""
    measured = []
    for path in paths:
        started = time.thread_time()
        check(path)
        measured.append(len(path) / (time.thread_time() - started))
    return measured
