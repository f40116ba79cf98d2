"""Paths of ten thousand points are planned, each in the time that its request is allowed; what is longer is refused."""

from __future__ import annotations

import math
import time
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.bus.wire import encoded
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import MOST_POINTS
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PlanResponse, Refusal, WaypointGoal
from gemelo.services.planner.core import Planner
from gemelo.services.planner.workers.plan_service import sendable

LIMIT = 60.0  # [s] of the processor; twenty times what it takes


def wave(points: int, arm: str, blend: float) -> tuple[Planner, PlanResponse]:
    """The plan of a path as a spray or glue program has it."""
    planner = Planner(load_arm(Path("urdf") / arm))
    names, ready = planner.arm.joint_names, planner.arm.named_states["ready"]
    via = tuple(
        JointGoal(name=(names[1],), position=(ready[1] + 0.2 * math.sin(index / 50),)) for index in range(points)
    )
    start = JointState(name=names, position=ready)
    request = PlanRequest(goal=WaypointGoal(points=via, blend=blend), start=start, allowed_time=LIMIT)
    return planner, planner.plan(request, None, 0.0, time.process_time)


@pytest.mark.parametrize("blend", [0.0, 0.002], ids=["stopping", "blended"])
def test_a_path_of_ten_thousand_points_is_planned(blend: float) -> None:
    planner, response = wave(10_000, "rm1", blend)
    assert response.code is PlanCode.SUCCESS, response.refusal
    assert response.trajectory.points[-1].time_from_start < 3600.0  # the gateway takes no longer one
    assert sendable(response) is response
    assert planner.planned_path(response.trajectory, 0).points


def test_a_path_with_more_points_than_are_followed_is_refused_with_both_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("gemelo.services.planner.core.MOST_POINTS", 300)
    _, response = wave(100, "rm1", 0.0)
    assert response.refusal is not None
    assert (response.refusal.check, response.refusal.limit) == ("points", float(MOST_POINTS))
    assert response.refusal.value is not None
    assert response.refusal.value > 300
    assert "split the path" in response.refusal.remedy
    assert response.trajectory.points == ()


def test_a_plan_that_no_message_can_carry_becomes_a_refusal_with_size_limit_and_remedy() -> None:
    answered = sendable(PlanResponse(code=PlanCode.SUCCESS, refusal=Refusal(message="x" * 40_000_000)))
    assert answered.code is PlanCode.PLANNING_FAILED
    assert answered.refusal is not None
    why = answered.refusal.why
    assert why is not None
    assert (why.code, why.values["limit"]) == ("plan.size", 33554432)
    assert why.values["size"] == answered.refusal.value
    assert answered.refusal.value is not None
    assert answered.refusal.value > 40_000_000
    assert answered.refusal.remedy.startswith("split the path")
    assert len(encoded(answered).payload) < 1000
