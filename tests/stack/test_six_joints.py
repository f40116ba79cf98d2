"""The same stack with the six-joint arm: chosen by one variable, moved to the step."""

from __future__ import annotations

import pytest

from schemas.actions import GoalStatusCode
from schemas.motion import FollowJointTrajectoryGoal
from schemas.planning import NamedGoal, PlanCode, PlanRequest
from schemas.topics import PLAN, STEP_ERRORS
from services.cli.stack import Stack
from tests.stack.person import Operator, jumps

NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "planner")


@pytest.fixture(scope="module")
def parol6(tmp_path_factory):
    environment = {"GEMELO_ROBOT": "urdf/parol6"}
    out = tmp_path_factory.mktemp("out")
    with Stack(broker="mosquitto", out=out, processes=NEEDED, environment=environment) as running:
        person = Operator(running)
        yield person
        person.close()


def test_six_joints_go_from_state_to_state_and_lose_no_step(parol6):
    worst = []
    parol6.node.subscribe(STEP_ERRORS, lambda message: worst.append(max(map(abs, message.error))))
    for name in ("ready", "left", "up", "home"):
        plan = parol6.node.call(PLAN, PlanRequest(goal=NamedGoal(name=name)), timeout=5.0)
        assert plan.code is PlanCode.SUCCESS, plan.refusal
        parol6.seen.clear()
        goal = FollowJointTrajectoryGoal(trajectory=plan.trajectory)
        outcome = parol6.follow.send(goal).wait(plan.duration + 10.0)
        assert outcome.status is GoalStatusCode.SUCCEEDED, outcome
        assert outcome.result.executed_steps == outcome.result.commanded_steps
        assert max(abs(error) for error in outcome.result.final_error) <= 0.5
        assert not jumps(parol6.arm, parol6.seen)
    assert len(worst) > 100
    assert max(worst) <= 0.5 + 1e-9
