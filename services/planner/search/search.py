"""Which search looks for a way, by `planner_id`, and what it asks about collisions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from schemas.planning import PlanCode, Refusal
from services.arm.description import Arm
from services.planner.refusals import NoPlan, unknown_name
from services.planner.scene.world import World
from services.planner.search.native_scene import native_scene
from services.planner.search.native_search import NATIVE, native_core, native_way, show_scene
from services.planner.search.ompl_search import PLANNERS, ompl_corners
from services.planner.search.smoothing import shorten, smooth
from services.planner.search.validity import CoalValidity, NativeValidity, Validity
from services.planner.search.way import Deadline, NoWay, Way, Why
from services.planner.times import Stopwatch

if TYPE_CHECKING:
    from services.planner.native import MotionCore

Array = NDArray[np.float64]

DEFAULT = "RRTConnect"  # where the compiled core is not built, or is too cautious
KNOWN = (NATIVE, *PLANNERS)
SEEDS = 2**32  # that are told apart; the generators take none below 0


class Search:
    """All searches for one arm in one scene."""

    def __init__(self, arm: Arm, world: World) -> None:
        self._arm = arm
        self._core: MotionCore | None = native_core(arm)
        self._world = world
        self._show(world)

    def heed(self, world: World) -> None:
        """What is kept clear of from now on."""
        if world is not self._world:
            self._show(world)
            self._world = world

    def _show(self, world: World) -> None:
        if self._core is not None:
            show_scene(self._core, *native_scene(self._arm, world.scene, world.folders))

    def find(
        self,
        start: Array,
        goals: Array,
        margin: float,
        planner_id: str,
        seed: int,
        deadline: Deadline,
        watch: Stopwatch,
    ) -> Way:
        """A smooth way from `start` (n,) to one of `goals` (m, n) that keeps `margin` [m]; raises `NoWay`, `NoPlan`."""
        require_known(planner_id)
        seed %= SEEDS
        if planner_id == NATIVE:
            return self._native(start, goals, margin, seed, deadline)
        if planner_id == "" and self._core is not None:
            try:
                return self._native(start, goals, margin, seed, deadline)
            except NoWay as no_way:
                if no_way.why is Why.TIMED_OUT:
                    raise
        return self._sampled(start, goals, margin, planner_id or DEFAULT, seed, deadline, watch)

    def _native(self, start: Array, goals: Array, margin: float, seed: int, deadline: Deadline) -> Way:
        if self._core is None:
            raise _not_built()
        self._core.margin = margin
        return native_way(self._core, start, goals, seed, deadline)

    def _sampled(
        self,
        start: Array,
        goals: Array,
        margin: float,
        planner_id: str,
        seed: int,
        deadline: Deadline,
        watch: Stopwatch,
    ) -> Way:
        validity = self._validity(start, goals, margin)
        corners = ompl_corners(self._arm, planner_id, start, goals, validity, seed, deadline)
        with watch.phase("smoothing"):
            corners = shorten(corners, validity, seed, deadline.is_late)
            return Way(corners, smooth(corners, validity, deadline.is_late), planner_id)

    def _validity(self, start: Array, goals: Array, margin: float) -> Validity:
        """The compiled core's spheres where they let the start and a goal be, otherwise the exact shapes."""
        if self._core is not None:
            self._core.margin = margin
            free = self._core.free(np.vstack((start, goals)))
            if free[0] and free[1:].any():
                return NativeValidity(self._core)
        return CoalValidity(self._world, margin)


def require_known(planner_id: str) -> None:
    """Raises `NoPlan` with the known ones."""
    if planner_id not in ("", *KNOWN):
        raise unknown_name(PlanCode.INVALID_GOAL_CONSTRAINTS, "unknown planner", planner_id, KNOWN, "gemelo")


def _not_built() -> NoPlan:
    return NoPlan(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="unknown planner",
            subject=NATIVE,
            message="the compiled motion core has not been built here",
            remedy=f"run `make setup`, or ask for {DEFAULT}",
        ),
    )
