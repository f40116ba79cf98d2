"""How many postures a second one core decides along the lines that a search asks for, self and scene."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from services.bench.arms import parol6
from services.bench.figure import Figure, NotMeasured, of_samples, quantile
from services.bench.postures import SCENE, CoalChecker, random_postures
from services.planner.collision.native_scene import native_scene

Array = NDArray[np.float64]

UNIT = "1/s"
WAYS, POINTS = 300, 200
FEW = 30  # of them for coal


def measure() -> Figure:
    """parol6 with the best build of the check; the others are the references."""
    try:
        from services.planner.native.binding import motion
        from services.planner.native.native_planner import NativePlanner
    except ImportError as error:
        raise NotMeasured(str(error)) from error
    arm = parol6()
    ways = lines(random_postures(arm, 2 * WAYS))
    samples: dict[str, list[float]] = {}
    for name in motion.kernel_names():
        core = NativePlanner(arm, kernel=name)
        core.set_scene(native_scene(arm, SCENE)[0])
        samples[name] = rates(core.free, ways)
    best = motion.kernel_names()[0]
    reference = {name: quantile(rate, 0.5) for name, rate in samples.items() if name != best}
    checker = CoalChecker(arm, SCENE)
    reference["pinocchio + coal"] = quantile(rates(lambda way: [checker.is_free(row) for row in way], ways[:FEW]), 0.5)
    note = (
        f"parol6, {len(SCENE.objects)} boxes, {best}, {WAYS} lines of {POINTS} postures; p99 is the fastest; CPU time"
    )
    return of_samples(samples[best], UNIT, None, reference, note)


def lines(rows: Array) -> list[Array]:
    """(points, n) each, between every two rows."""
    shares = np.linspace(0.0, 1.0, POINTS)[:, None]
    return [start + shares * (goal - start) for start, goal in zip(rows[::2], rows[1::2], strict=True)]


def rates(check: Callable[[Array], object], ways: list[Array]) -> list[float]:
    """[1/s] for each line."""
    measured = []
    for way in ways:
        started = time.thread_time()
        check(way)
        measured.append(len(way) / (time.thread_time() - started))
    return measured
