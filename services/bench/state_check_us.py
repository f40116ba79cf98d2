"""Whether one posture is free, self and scene: the motion core in batches, against pinocchio and coal."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.bench.arms import parol6, rm1
from services.bench.figure import Figure, NotMeasured, of_samples, quantile
from services.bench.postures import SCENE, CoalChecker, random_postures
from services.planner.collision.native_scene import native_scene

if TYPE_CHECKING:
    from services.planner.native.native_planner import NativePlanner

Array = NDArray[np.float64]
Question = TypeVar("Question")

UNIT = "us"
BATCH, BATCHES = 1000, 40
ONE_BY_ONE = 2000
TEN = 10  # calls that are timed at once: the clock of the CPU takes as long as a part of one


def measure() -> Figure:
    """parol6's figure; the references are of the same postures in the same run."""
    try:
        from services.planner.native.native_planner import NativePlanner
    except ImportError as error:
        raise NotMeasured(str(error)) from error
    arm = parol6()
    core = NativePlanner(arm)
    core.set_scene(native_scene(arm, SCENE)[0])
    rows = random_postures(arm, BATCH * BATCHES)
    samples = []
    for batch in np.array_split(rows, BATCHES):
        started = time.thread_time()
        core.free(batch)
        samples.append((time.thread_time() - started) / BATCH * 1e6)
    reference = {
        "pinocchio + coal, same scene": coal_us(arm),
        "services.arm.kinematics, self only": self_us(arm),
        "motion core, one posture a call": single_us(core, rows),
        "rm1, motion core": batch_us(rm1()),
        "rm1, pinocchio + coal, same scene": coal_us(rm1()),
    }
    note = (
        f"parol6, {core.sphere_count} spheres, {len(SCENE.objects)} boxes, batches of {BATCH} random postures within "
        f"the limits, {core.kernel}, CPU time"
    )
    return of_samples(samples, UNIT, None, reference, note)


def batch_us(arm: Arm) -> float:
    """[us] median of a posture in a batch, with the motion core."""
    from services.planner.native.native_planner import NativePlanner

    core = NativePlanner(arm)
    core.set_scene(native_scene(arm, SCENE)[0])
    return median_us(core.free, np.array_split(random_postures(arm, BATCH * BATCHES), BATCHES)) / BATCH


def single_us(core: NativePlanner, rows: Array) -> float:
    """[us] median of one posture, the call from Python included."""
    each = [row[None, :] for row in rows[:ONE_BY_ONE]]
    tens = [each[first : first + TEN] for first in range(0, ONE_BY_ONE, TEN)]
    return median_us(lambda some: [core.free(row) for row in some], tens) / TEN


def coal_us(arm: Arm) -> float:
    """[us] median of one posture with pinocchio and coal."""
    return median_us(CoalChecker(arm, SCENE).is_free, random_postures(arm, ONE_BY_ONE))


def self_us(arm: Arm) -> float:
    """[us] median of one posture's distances of the links to one another, no scene."""
    return median_us(Kinematics(arm).collisions.distance, random_postures(arm, ONE_BY_ONE))


def median_us(ask: Callable[[Question], object], questions: Iterable[Question]) -> float:
    """[us] of one question, half of them faster."""
    samples = []
    for question in questions:
        started = time.thread_time()
        ask(question)
        samples.append((time.thread_time() - started) * 1e6)
    return quantile(samples, 0.5)
