"""The same stack with the six-joint arm: chosen by one variable, moved to the step."""

from __future__ import annotations

import json
import time

import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.topics import PLAN, STEP_ERRORS
from tests.stack.gemelo import gemelo
from tests.stack.person import Operator, jumps


@pytest.fixture
def parol6(parol6_stack):
    person = Operator(parol6_stack)
    yield person
    person.close()


def test_six_joints_go_from_state_to_state_and_lose_no_step(parol6):
    worst = []
    parol6.node.subscribe(STEP_ERRORS, lambda message: worst.append(max(map(abs, message.error))))
    for name in ("ready", "left", "up", "home"):
        plan = parol6.node.call(PLAN, PlanRequest(goal=NamedGoal(name=name)), timeout=60.0)
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


def test_the_switches_are_passed_and_verify_all_joints_without_homing(parol6):
    plan = parol6.node.call(PLAN, PlanRequest(goal=NamedGoal(name="ready")), timeout=60.0)
    assert parol6.send(plan).wait(plan.duration + 10.0).status is GoalStatusCode.SUCCEEDED
    report = json.loads(gemelo(parol6.stack, "verify", "joint_1", "joint_4", "joint_6", "--json"))
    assert sorted(report["passed"]) == ["joint_1", "joint_4", "joint_6"]
    assert (report["homed"], report["without_switch"]) == ([], [])
    said = gemelo(parol6.stack, "state")
    assert said.count(" switch") == 3


def test_the_tool_is_jogged_on_a_line_and_turned_and_stops_without_a_jump(parol6):
    plan = parol6.node.call(PLAN, PlanRequest(goal=NamedGoal(name="ready")), timeout=60.0)
    assert parol6.send(plan).wait(plan.duration + 10.0).status is GoalStatusCode.SUCCEEDED
    worst = []
    parol6.node.subscribe(STEP_ERRORS, lambda message: worst.append(max(map(abs, message.error))))
    parol6.seen.clear()
    places = []
    for words in (["--joint", "joint_6=30deg/s"], ["--twist", "0.04", "0.03", "0"], ["--turn", "0", "0", "20deg/s"]):
        gemelo(parol6.stack, "jog", *words, "--for", "1")
        ended = time.time_ns()
        assert parol6.wait_for(lambda ended=ended: parol6.seen and parol6.seen[-1].stamp > ended, 60.0)
        assert not parol6.is_moving()
        places.append(Kinematics(parol6.arm).tool(parol6.seen[-1].position))
    way = places[1].position - places[0].position
    assert way[0] > 0.02
    assert way[1] == pytest.approx(0.75 * way[0], abs=0.001)
    assert abs(way[2]) < 0.001
    assert places[2].position == pytest.approx(places[1].position, abs=0.001)
    turn = places[2].rotation @ places[1].rotation.T
    assert turn[1, 0] > 0.15  # about the base's z
    assert turn[2, 2] == pytest.approx(1.0, abs=1e-4)
    assert not jumps(parol6.arm, parol6.seen)
    assert max(worst) <= 0.5 + 1e-9
