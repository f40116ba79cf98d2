"""One request on its way to a trajectory, with all that holds for the whole of it."""

from __future__ import annotations

from typing import NamedTuple

from gemelo.schemas.planning import PlanRequest
from gemelo.services.planner.path.path import Start
from gemelo.services.planner.pipeline.trajectory_builder import TrajectoryBuilder
from gemelo.services.planner.request.deadline import Deadline, Stopwatch
from gemelo.services.planner.timing.profile import JointLimits


class PlanningContext(NamedTuple):
    """From `start`, within `limits`, `margin` [m] away from everything."""

    request: PlanRequest
    start: Start
    limits: JointLimits
    margin: float
    builder: TrajectoryBuilder
    deadline: Deadline
    watch: Stopwatch
