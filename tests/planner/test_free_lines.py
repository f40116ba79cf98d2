"""A straight line is looked at once; what will be executed is looked at again wherever it leaves that line."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import NamedGoal, PlanRequest
from gemelo.services.planner.pipeline.trajectory_builder import TrajectoryBuilder, TrajectoryTouches, lies_on
from gemelo.services.planner.request.deadline import Stopwatch, endless
from gemelo.services.planner.timing.profile import joint_limits, straight_line

GOAL = (1.0, -0.5, 0.1)


class TouchesInTheMiddle:
    """Free where it is asked about two rows, never where it is asked about more; counts the questions."""

    clearance = 0.004
    reach = np.ones(3)

    def __init__(self) -> None:
        self.asked: list[int] = []

    def distance(self, positions: np.ndarray) -> float:
        return 1.0

    def pairs_within(self, positions: np.ndarray, margin: float = 0.0) -> list[tuple[str, str]]:
        return []

    def touching(self, positions: np.ndarray, margin: float) -> np.ndarray | None:
        self.asked.append(len(positions))
        return None if len(positions) == 2 else positions[len(positions) // 2]


def builder(arm: ArmDescription, checker: TouchesInTheMiddle) -> TrajectoryBuilder:
    request = PlanRequest(goal=NamedGoal(name="home"))
    return TrajectoryBuilder(arm, checker, request, joint_limits(arm), 0.004, Stopwatch(endless))


def test_a_straight_line_is_asked_about_once(rm1: ArmDescription):
    checker = TouchesInTheMiddle()
    found = builder(rm1, checker).line((0.0, 0.0, 0.0), GOAL)
    assert found.trajectory.points[-1].positions == GOAL
    assert checker.asked == [2]


def test_a_trajectory_beside_the_line_that_is_free_is_asked_about_as_a_whole(rm1: ArmDescription):
    trajectory = straight_line(rm1.joint_names, (0.0, 0.0, 0.0), GOAL, joint_limits(rm1))
    other = np.array(((0.0, 0.0, 0.0), (1.0, -0.5, 0.1 + 1e-6)))
    checker = TouchesInTheMiddle()
    with pytest.raises(TrajectoryTouches):
        builder(rm1, checker).verified(trajectory, (0.0, 0.0, 0.0), GOAL, other)
    assert checker.asked[0] > 2


@given(st.integers(0, 10_000), st.floats(1e-8, 1.0), st.booleans())
def test_rows_lie_on_a_line_only_where_they_are_between_its_ends(seed: int, aside: float, is_beyond: bool):
    random = np.random.default_rng(seed)
    line = random.uniform(-3.0, 3.0, (2, 6))
    rows = line[0] + random.uniform(0.0, 1.0, (40, 1)) * (line[1] - line[0])
    assert lies_on(line, rows)
    way = (line[1] - line[0]) / float(np.linalg.norm(line[1] - line[0]))
    across = np.roll(way, 1) - way * float(np.roll(way, 1) @ way)
    moved = rows.copy()
    moved[7] = line[1] + 3.0 * aside * way if is_beyond else rows[7] + 3.0 * aside * across / np.linalg.norm(across)
    assert not lies_on(line, moved)
    moved[7] = np.nan
    assert not lies_on(line, moved)
