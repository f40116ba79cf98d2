"""The real planner on a bus in memory, recorded and replayed: what it was asked, in scenes that change between."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from schemas.frames import Transform
from schemas.gripper import GripperState
from schemas.joints import JointState
from schemas.planning import JointGoal, NamedGoal, PlanCode, PlanRequest
from schemas.scene import SceneAdd, SceneClear, SceneObject, SceneRequest, SphereShape
from schemas.topics import DESCRIPTION, GRIPPER_STATE, PLAN, SCENE_EDIT
from services.arm.model.description import load_arm
from services.recordings.channels import Entry
from services.recordings.mcap_file import McapFile
from services.recordings.table import recorded_topics
from services.replay.main import replay, text_of
from services.replay.planner import PLANS, TOPICS, UNPLANNED
from services.runtime.deployment import project_root
from services.runtime.node import Node
from services.state_publisher.main import describe
from tests.planner.planning_node import beside_a_planner

PATIENCE = 60.0  # [s]
NAMES = ("brazo_joint", "antebrazo_joint", "efector_joint")
HOME = JointState(name=NAMES, position=(0.0, 0.0, 0.0))
READY = PlanRequest(goal=NamedGoal(name="ready"), start=HOME, allowed_time=30.0)


@pytest.fixture
def planner(tmp_path: Path):
    with beside_a_planner(tmp_path, "person", ends_within=PATIENCE) as node:
        yield node


class Recorder:
    """Everything that a replay of the planner needs, as it comes."""

    def __init__(self, node: Node, path: Path) -> None:
        self.entries: list[Entry] = []
        self._node, self._path = node, path
        wanted = {topic.key for topic in TOPICS}
        for topic in (each for each in recorded_topics() if each.key in wanted):
            node.subscribe(topic, lambda said, topic=topic: self._keep(topic, said), own=True, batch=0.0)

    def _keep(self, topic, said) -> None:
        self.entries.append(Entry(topic, said, time.time_ns()))

    def answers(self) -> int:
        return sum(entry.topic.key == PLANS.key for entry in self.entries)

    def write(self) -> Path:
        file = McapFile(self._path, {"deployment": {"json": '{"robot": "urdf/rm1"}'}})
        arm = load_arm(project_root() / "urdf/rm1")
        file.write([Entry(DESCRIPTION, describe(arm), self.entries[0].arrival), *self.entries])
        file.close()
        return self._path


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
    assert replayed.alike == {PLANS.key: 4, "planned_path": 2}
    assert replayed.aside == {UNPLANNED: 1}
