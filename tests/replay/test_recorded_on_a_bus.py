"""The real planner on a bus in memory, recorded and replayed: what it was asked, in scenes that change between."""

from __future__ import annotations

import time
from pathlib import Path

from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import Transform
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.scene import SceneAdd, SceneClear, SceneObject, SceneRequest, SphereShape
from gemelo.schemas.topics import GRIPPER_STATE, PLAN, SCENE_EDIT
from gemelo.tools.replay.main import replay, text_of
from gemelo.tools.replay.planner import PLANS, UNPLANNED
from tests.replay.recorded_bus import PATIENCE, Recorder

NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")
HOME = JointState(name=NAMES, position=(0.0, 0.0, 0.0))
READY = PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=30.0)


def test_plans_in_scenes_that_change_are_made_again_to_the_byte(planner: Node, tmp_path: Path):
    recorder = Recorder(planner, tmp_path / "plans.mcap")
    said = []

    def ask(request: PlanRequest) -> None:
        said.append(planner.call(PLAN, request, PATIENCE, on_tick=lambda: None).code)

    ask(READY)
    ball = SceneObject(name="ball", shape=SphereShape(radius=3.0), pose=Transform(translation=(0.0, 0.0, 0.0)))
    planner.call(SCENE_EDIT, SceneRequest(edit=SceneAdd(object=ball)), PATIENCE)
    ask(READY)
    planner.call(SCENE_EDIT, SceneRequest(edit=SceneClear()), PATIENCE)
    planner.publisher(GRIPPER_STATE).put(GripperState(known=True, position=0.01))
    ask(PlanRequest(goal=JointGoal(name=NAMES, position=(0.4, 0.2, 0.02)), start=HOME, allowed_time=30.0))
    ask(PlanRequest(goal=NamedGoal(name="nowhere"), start=HOME, allowed_time=30.0))
    ask(PlanRequest(goal=NamedGoal(name="ready"), request_id="x" * 101))
    end = time.monotonic() + PATIENCE
    while recorder.answers() < 5:
        assert time.monotonic() < end
        planner.wait(0.02)
    assert said[:3] == [PlanCode.SUCCESS, PlanCode.START_STATE_IN_COLLISION, PlanCode.SUCCESS]

    replayed = replay(recorder.write(), "planner")
    assert replayed.difference is None, text_of(replayed)
    edits = {"@request/scene/edit": 2, "scene": 2}
    assert replayed.alike == {PLANS.key: 4, "planned_path": 2, **edits}
    assert replayed.aside == {UNPLANNED: 1}
