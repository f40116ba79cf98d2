"""The planner's scene on a bus: edited, latched, kept over a restart, and shown where it is touched."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest, PlanResponse, PointToPoint
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import (
    BoxShape,
    PlanningScene,
    SceneAdd,
    SceneAttach,
    SceneClear,
    SceneEdit,
    SceneObject,
    SceneRemove,
    SceneRequest,
    SceneResponse,
    SphereShape,
)
from gemelo.schemas.topics import CONTACTS, JOINT_STATES, PLAN, SCENE, SCENE_EDIT
from gemelo.services.planner.scene.scene_file import load_scene, save_scene
from tests.planner.planning_node import beside_a_planner

WAIT = 5.0  # [s]
LONG_WAIT = 60.0  # [s]
GOAL = PlanRequest(goal=JointGoal(name=("brazo_joint",), position=(1.2,)), motion=PointToPoint())


@pytest.fixture
def asker(tmp_path: Path) -> Iterator[Node]:
    with beside_a_planner(tmp_path, ends_within=LONG_WAIT) as node:
        yield node


def edit(asker: Node, edit: SceneEdit) -> SceneResponse:
    return asker.call(SCENE_EDIT, SceneRequest(edit=edit), timeout=WAIT)


def stand(asker: Node, arm: ArmDescription) -> None:
    """A fresh joint state at rest in the home pose."""
    states = asker.publisher(JOINT_STATES)
    for _ in range(3):
        states.put(JointState(stamp=asker.now(), name=arm.joint_names, position=(0.0,) * len(arm.joints)))
        time.sleep(0.03)


def plan(asker: Node, arm: ArmDescription) -> PlanResponse:
    """With joint states all the while: the planner's worker may have to start first."""
    stop = threading.Event()

    def keep_standing() -> None:
        while not stop.is_set():
            stand(asker, arm)

    thread = threading.Thread(target=keep_standing)
    thread.start()
    try:
        return asker.call(PLAN, GOAL, timeout=LONG_WAIT)
    finally:
        stop.set()
        thread.join(WAIT)


def block(arm: ArmDescription) -> SceneObject:
    """In the way of the goal."""
    at = Kinematics(arm).tool((0.6, 0.0, 0.0)).position.tolist()
    return SceneObject(name="block", shape=BoxShape(size=(0.04, 0.04, 0.04)), pose=Transform(translation=tuple(at)))


def test_an_edit_is_answered_latched_and_heeded_by_the_next_plan(asker: Node, rm1: ArmDescription) -> None:
    assert edit(asker, SceneAdd(object=block(rm1))) == SceneResponse(accepted=True, version=1)
    scene = asker.latest(SCENE)
    asker.wait(0.2)
    assert scene.message is not None
    assert scene.message.objects == (block(rm1),)
    refused = plan(asker, rm1)
    assert refused.refusal is not None
    assert "box block" in refused.refusal.message
    assert refused.scene_version == 1
    assert edit(asker, SceneRemove(name="block")).version == 2
    assert plan(asker, rm1).code is PlanCode.SUCCESS


def test_what_touches_is_shown_until_a_plan_succeeds(asker: Node, rm1: ArmDescription) -> None:
    contacts = asker.latest(CONTACTS)
    edit(asker, SceneAdd(object=block(rm1)))
    refused = plan(asker, rm1)
    asker.wait(0.2)
    assert contacts.message is not None
    assert refused.refusal is not None
    assert contacts.message.name == rm1.joint_names
    assert contacts.message.position == refused.refusal.configuration
    assert contacts.message.contacts[0].second == "block"
    assert len(contacts.message.contacts[0].point) == 3
    edit(asker, SceneClear())
    plan(asker, rm1)
    asker.wait(0.2)
    assert contacts.message.contacts == ()


def test_what_is_put_onto_the_arm_is_shown_to_touch_it_until_it_is_taken_away(asker: Node, rm1: ArmDescription) -> None:
    contacts, states = asker.latest(CONTACTS), asker.publisher(JOINT_STATES)
    standing = JointState(name=rm1.joint_names, position=(0.6, 0.0, 0.0))
    edit(asker, SceneClear())  # answered: the planner is there and hears where the arm stands
    for change in (SceneAdd(object=block(rm1)), SceneRemove(name="block")):
        states.put(msgspec.structs.replace(standing, stamp=asker.now()))
        asker.wait(0.1)
        edit(asker, change)
        asker.wait(0.2)
        assert contacts.message is not None
        touching = [contact.second for contact in contacts.message.contacts]
        assert touching == (["block"] if isinstance(change, SceneAdd) else [])
        assert contacts.message.position == (standing.position if touching else ())


def test_a_bad_edit_is_refused_by_name_and_changes_nothing(asker: Node) -> None:
    response = edit(asker, SceneRemove(name="block"))
    assert response == SceneResponse(
        reason='there is no object "block"; none is known',
        why=because("scene.object.unknown", remedy("none_known"), object="block"),
    )
    response = edit(asker, SceneAdd(object=SceneObject(name="ball", shape=SphereShape(radius=0.0))))
    assert response.reason.startswith('object "ball": radius of the sphere is 0 m')
    assert response.version == 0


def test_attaching_needs_to_know_where_the_arm_is(asker: Node, rm1: ArmDescription) -> None:
    edit(asker, SceneAdd(object=SceneObject(name="cup", shape=SphereShape(radius=0.01))))
    attach = SceneAttach(name="cup", link=rm1.tool_frame)
    assert "it is not known where the arm is" in edit(asker, attach).reason
    stand(asker, rm1)
    assert edit(asker, attach).accepted


def test_a_restart_has_the_scene_as_it_was(tmp_path: Path, rm1: ArmDescription) -> None:
    with beside_a_planner(tmp_path, ends_within=LONG_WAIT) as asker:
        edit(asker, SceneAdd(object=block(rm1)))
        before = asker.latest(SCENE)
        asker.wait(0.2)
    with beside_a_planner(tmp_path, ends_within=LONG_WAIT) as asker:
        after = asker.latest(SCENE)
        refused = plan(asker, rm1)
        asker.wait(0.2)
        assert after.message == before.message
        assert refused.refusal is not None
        assert "box block" in refused.refusal.message
        assert edit(asker, SceneClear()).version == 2


def test_a_damaged_file_is_kept_aside_and_the_planner_serves(tmp_path: Path, rm1: ArmDescription) -> None:
    (tmp_path / "scene.json").write_text('{"objects": [')
    with beside_a_planner(tmp_path, ends_within=LONG_WAIT) as asker:
        assert plan(asker, rm1).code is PlanCode.SUCCESS
        assert (tmp_path / "scene.json.damaged").read_text() == '{"objects": ['
        assert edit(asker, SceneAdd(object=block(rm1))).version == 1


def test_what_does_not_fit_the_arm_is_left_out_and_the_rest_stays(tmp_path: Path, rm1: ArmDescription) -> None:
    lost = SceneObject(name="lost", shape=SphereShape(radius=0.1), frame="no_link", attached=True)
    save_scene(tmp_path / "scene.json", PlanningScene(version=5, objects=(block(rm1), lost)))
    with beside_a_planner(tmp_path, ends_within=LONG_WAIT) as asker:
        scene = asker.latest(SCENE)
        assert edit(asker, SceneRemove(name="lost")).reason == 'there is no object "lost"; known are block'
        asker.wait(0.1)
        assert scene.message is not None
        assert scene.message.objects == (block(rm1),)
        assert (tmp_path / "scene.json.damaged").exists()
        assert load_scene(tmp_path / "scene.json") == scene.message
