"""Named states of the SRDF: of all joints, and of groups that have only some of them."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.planning import LinearMotion, NamedGoal, PlanCode, PointToPoint, WaypointGoal
from gemelo.services.planner.core import Planner
from tests.planner.judging import asked

START = (0.4, -0.9, 0.06)
PARTS = """
  <group name="forearm"><joint name="antebrazo_joint"/></group>
  <group_state name="bent" group="forearm"><joint name="antebrazo_joint" value="1.0"/></group_state>
  <group_state name="ready" group="forearm"><joint name="antebrazo_joint" value="1.5"/></group_state>
  <group_state name="outside" group="forearm"><joint name="antebrazo_joint" value="9.0"/></group_state>
  <group name="hand"/>
  <group_state name="open" group="hand"><joint name="finger" value="0.1"/></group_state>
</robot>"""


@pytest.fixture(scope="module")
def planner(rm1_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Planner:
    folder = Path(shutil.copytree(rm1_folder, tmp_path_factory.mktemp("arms") / "rm1"))
    srdf = folder / "robot.srdf"
    srdf.write_text(srdf.read_text().replace("</robot>", PARTS))
    return Planner(load_arm(folder))


def test_a_state_of_some_joints_leaves_the_others_where_they_are(planner: Planner):
    response = planner.plan(asked(planner, START, NamedGoal(name="bent"), motion=PointToPoint()), None)
    assert response.code is PlanCode.SUCCESS
    assert response.trajectory.points[-1].positions == (START[0], 1.0, START[2])


@pytest.mark.parametrize("motion", [PointToPoint(), LinearMotion(least_fraction=0.0)])
def test_on_the_way_it_leaves_them_where_the_waypoint_before_has_them(planner: Planner, motion: object):
    goal = WaypointGoal(points=(NamedGoal(name="left"), NamedGoal(name="bent")))
    response = planner.plan(asked(planner, (1.1, 0.6, 0.05), goal, motion=motion), None)
    assert response.code is PlanCode.SUCCESS
    brazo, _, efector = planner.arm.named_states["left"]
    assert response.trajectory.points[-1].positions == (brazo, 1.0, efector)


def test_the_arms_own_state_comes_before_that_of_a_part_with_the_same_name(planner: Planner):
    response = planner.plan(asked(planner, START, NamedGoal(name="ready")), None)
    assert response.trajectory.points[-1].positions == planner.arm.named_states["ready"] == (0.6, -1.2, 0.08)


def test_a_state_of_some_joints_is_held_against_their_limits(planner: Planner):
    refused = planner.plan(asked(planner, START, NamedGoal(name="outside")), None).refusal
    assert refused is not None
    assert (refused.check, refused.subject, refused.value) == ("joint limit", "antebrazo_joint", 9.0)


def test_an_unknown_state_is_told_the_known_ones_but_not_those_of_joints_that_nothing_drives(planner: Planner):
    refused = planner.plan(asked(planner, START, NamedGoal(name="zzz")), None).refusal
    assert refused is not None
    assert (refused.check, refused.subject) == ("unknown state", "zzz")
    for known in ("bent", "outside", "folded", "home", "left", "lifted", "ready", "right"):
        assert known in refused.remedy
    assert "open" not in refused.remedy
    close = planner.plan(asked(planner, START, NamedGoal(name="bend")), None).refusal
    assert close is not None
    assert close.remedy == 'use "bent"'
