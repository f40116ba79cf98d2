"""The planner as a node on a bus: asked, answering, ready only while it knows where the arm is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FkRequest, IkRequest, NamedGoal, PlanCode, PlanRequest, PoseGoal
from gemelo.schemas.topics import FK, IK, JOINT_STATES, PLAN, PLANNED_PATH
from tests.planner.planning_node import beside_a_planner


@pytest.fixture
def asker(tmp_path: Path) -> Iterator[Node]:
    with beside_a_planner(tmp_path) as node:
        yield node


def tell(asker: Node, arm: ArmDescription) -> None:
    """A second of joint states at rest in the home pose."""
    states = asker.publisher(JOINT_STATES)
    for _ in range(10):
        states.put(JointState(stamp=asker.now(), name=arm.joint_names, position=(0.0,) * len(arm.joints)))
        asker.wait(0.03)


def test_it_plans_from_the_newest_joint_state_and_shows_the_way(asker: Node, rm1: ArmDescription, tmp_path: Path):
    path = asker.latest(PLANNED_PATH)
    asker.call(PLAN, PlanRequest(), timeout=30.0)  # once its process has started, nothing is stale by waiting for it
    tell(asker, rm1)
    response = asker.call(PLAN, PlanRequest(goal=PoseGoal(position=(0.25, 0.15, 0.10))), timeout=30.0)
    asker.wait(0.2)
    assert response.code is PlanCode.SUCCESS
    assert response.planning_time > 0.0
    assert path.message is not None
    assert path.message.points[-1] == pytest.approx((0.25, 0.15, 0.10), abs=1e-6)
    assert (tmp_path / "planner.ready").exists()


def test_without_joint_states_it_is_not_ready_and_says_why(asker: Node, tmp_path: Path):
    response = asker.call(PLAN, PlanRequest(goal=NamedGoal(name="ready")), timeout=30.0)
    assert response.code is PlanCode.ROBOT_STATE_STALE
    assert not (tmp_path / "planner.ready").exists()


def test_it_answers_ik_and_fk_from_the_newest_joint_state(asker: Node, rm1: ArmDescription):
    tell(asker, rm1)
    found = asker.call(IK, IkRequest(goal=PoseGoal(position=(0.25, 0.15, 0.10)), solutions=4), timeout=30.0)
    assert found.code is PlanCode.SUCCESS
    assert len(found.solutions) == 2
    back = asker.call(FK, FkRequest(name=found.name, position=found.solutions[0].position), timeout=30.0)
    assert back.poses[0].translation == pytest.approx((0.25, 0.15, 0.10), abs=1e-6)
    assert asker.call(FK, FkRequest(), timeout=30.0).code is PlanCode.SUCCESS
