"""One request on its way to a trajectory, with all that holds for the whole of it."""

from __future__ import annotations

from dataclasses import dataclass

from schemas.planning import PlanRequest
from services.planner.finish import Finisher
from services.planner.goals.goals import timed_out
from services.planner.search.way import Deadline, Start
from services.planner.times import Stopwatch
from services.planner.timing.profile import JointLimits


@dataclass(frozen=True)
class Errand:
    """From `start`, within `limits`, `margin` [m] away from everything."""

    request: PlanRequest
    start: Start
    limits: JointLimits
    margin: float
    finisher: Finisher
    deadline: Deadline
    watch: Stopwatch

    def heed(self) -> None:
        """Raises `NoPlan` where the time is up."""
        if self.deadline.is_late():
            raise timed_out()
