"""Goals of joints without limits: any turn meets them where any way will do, the value itself where it can be had."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.planning import FreeMotion, JointGoal, Motion, PlanCode, PlanResponse, PointToPoint
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.core import Planner
from tests.planner.judging import asked, require_sound, show
from tests.planner.walled import NAMES, wall

ROOT = Path(__file__).resolve().parents[2]
START, BEYOND = (0.0, 0.3, 0.05), (1.2, 0.3, 0.05)  # on both sides of the wall


@pytest.fixture(scope="module")
def planner(tmp_path_factory: pytest.TempPathFactory) -> Planner:
    """rm1 whose column turns without end."""
    folder = tmp_path_factory.mktemp("turns") / "rm1"
    shutil.copytree(ROOT / "urdf/rm1", folder)
    urdf = (folder / "robot.urdf").read_text()
    (folder / "robot.urdf").write_text(urdf.replace('"brazo_joint" type="revolute"', '"brazo_joint" type="continuous"'))
    settings = (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(settings.replace("mechanical_lower = -3.1\nmechanical_upper = 3.1\n", "", 1))
    planner = Planner(load_arm(folder))
    assert math.isinf(planner.arm.joints[0].upper)
    return planner


def planned(planner: Planner, scene: PlanningScene, column: float, motion: Motion) -> PlanResponse:
    show(planner, scene)
    request = asked(planner, START, JointGoal(name=NAMES, position=(column, *BEYOND[1:])), motion=motion)
    response = planner.plan(request, None)
    if response.code is PlanCode.SUCCESS:
        require_sound(planner, request, response)
    return response


@pytest.mark.parametrize("angle", [0.6, -0.6])
def test_it_goes_the_other_way_round_where_the_direct_one_is_blocked(planner: Planner, angle: float) -> None:
    goal = math.copysign(BEYOND[0], angle)
    walled = PlanningScene(version=2, objects=(wall("wall", angle),))
    response = planned(planner, walled, goal, FreeMotion())
    assert response.refusal is None
    end = response.trajectory.points[-1].positions
    assert np.allclose(end, (goal - math.copysign(math.tau, angle), *BEYOND[1:]), atol=1e-9)


@pytest.mark.parametrize("turns", [-1, 0, 2])
def test_where_nothing_is_in_the_way_the_value_itself_is_gone_to(planner: Planner, turns: int) -> None:
    goal = BEYOND[0] + turns * math.tau
    response = planned(planner, PlanningScene(version=3), goal, FreeMotion())
    assert response.trajectory.points[-1].positions[0] == goal


def test_the_straight_line_of_the_joints_leads_to_the_value_itself_or_is_refused(planner: Planner) -> None:
    walled = PlanningScene(version=4, objects=(wall("wall", 0.6),))
    refusal = planned(planner, walled, BEYOND[0], PointToPoint()).refusal
    assert refusal is not None
    assert refusal.check == "collision"
