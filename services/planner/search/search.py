"""Which search looks for a way, by `planner_id`, and what it asks about collisions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schemas.planning import PlanCode, Refusal
from services.arm.description import Arm
from services.planner.refusals import NoPlan, unknown_name
from services.planner.scene.surroundings import Surroundings
from services.planner.search.native_search import NATIVE, native_way
from services.planner.search.ompl_search import PLANNERS, ompl_corners
from services.planner.search.smoothing import shorten, smooth
from services.planner.search.validity import CoalValidity, NativeValidity, Validity
from services.planner.search.way import Deadline, NoWay, Way, Why
from services.planner.times import Stopwatch

Array = NDArray[np.float64]

DEFAULT = "RRTConnect"  # where the compiled core is not built, or is too cautious
KNOWN = (NATIVE, *PLANNERS)
SEEDS = 2**32  # that are told apart; the generators take none below 0


class Search:
    """All searches for one arm, in the world of the plan at hand."""

    def __init__(self, arm: Arm, surroundings: Surroundings) -> None:
        self._arm, self._surroundings = arm, surroundings

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
        core = self._surroundings.core(margin)
        if planner_id == NATIVE and core is None:
            raise _not_built()
        if planner_id == NATIVE and core is not None:
            return native_way(core, start, goals, seed, deadline)
        if planner_id == "" and core is not None:
            try:
                return native_way(core, start, goals, seed, deadline)
            except NoWay as no_way:
                if no_way.why is Why.TIMED_OUT:
                    raise
        return self._sampled(start, goals, margin, planner_id or DEFAULT, seed, deadline, watch)

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
        core = self._surroundings.core(margin)
        if core is not None:
            free = core.free(np.vstack((start, goals)))
            if free[0] and free[1:].any():
                return NativeValidity(core)
        return CoalValidity(self._surroundings.world, margin)


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
