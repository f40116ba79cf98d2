"""A planner that says it is ready has loaded all that its first plan needs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FIRST_PLAN = """
import sys
from pathlib import Path

from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JointGoal, PlanRequest
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.libraries.arm.model.description import load_arm
from gemelo.services.planner.core import Planner
from gemelo.services.planner.collision.world import World

arm = load_arm(Path("urdf/rm1"))
planner = Planner(arm)
post = SceneObject(name="post", shape=BoxShape(size=(0.05, 0.05, 0.3)), pose=Transform(translation=(0.28, 0.19, 0.1)))
planner.set_world(World(arm, planner.kinematics, PlanningScene(version=1, objects=(post,))))
planner.prepare()
loaded = set(sys.modules)
start = JointState(name=arm.joint_names, position=(0.0, 0.3, 0.05))
goal = JointGoal(name=arm.joint_names, position=(1.2, 0.3, 0.05))
response = planner.plan(PlanRequest(start=start, goal=goal, motion=FreeMotion(planner_id=sys.argv[1])), None)
print(response.planner_id, *sorted(set(sys.modules) - loaded))
"""


@pytest.mark.parametrize("planner_id", ["native", "RRTConnect", "PRM"])
def test_the_first_plan_imports_nothing(planner_id: str):
    command = [sys.executable, "-c", FIRST_PLAN, planner_id]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout.split() == [planner_id]
