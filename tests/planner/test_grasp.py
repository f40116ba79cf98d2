"""The object between the jaws is found, attached and left; and the jaws themselves are kept clear of everything."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.frames.transforms import Rigid, compose, from_message, from_rpy, to_message
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.arm.model.jaws import JAWS, jaw_objects, jaws_apart
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.frames import Transform
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlanCode, ValidityRequest
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.scene import (
    AllowedPair,
    BoxShape,
    CylinderShape,
    PlaneShape,
    PlanningScene,
    SceneAdd,
    SceneAllow,
    SceneEdit,
    SceneGrip,
    SceneObject,
    SceneRelease,
    SceneRequest,
    SceneResponse,
    Shape,
    SphereShape,
)
from gemelo.schemas.topics import GRIPPER_STATE, JOINT_STATES, SCENE, STATE_VALIDITY
from gemelo.services.planner.collision.scene_shapes import shape_of
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.scene.grasp import width_of
from gemelo.services.planner.scene.scene_store import SceneStore
from tests.planner.planning_node import beside_a_planner
from tests.planner.test_scene_node import edit
from tests.profiles import examples

ROOT = Path(__file__).parents[2]
ARMS = {name: load_arm(ROOT / "urdf" / name) for name in ("rm1", "parol6")}
MIDDLE = 0.008  # [m] beyond the tool frame, between the jaws
TURN = st.floats(-math.pi, math.pi)


class Cell:
    """A scene about an arm in its state "left"."""

    def __init__(self, name: str) -> None:
        self.arm = ARMS[name]
        self.store = SceneStore(self.arm)
        self.links = Kinematics(self.arm).link_poses(self.arm.named_states["left"])

    def edit(self, change: SceneEdit) -> SceneResponse:
        return self.store.edit(SceneRequest(edit=change), lambda: self.links, 1)

    def add(self, name: str, shape: Shape, at: tuple[float, float, float]) -> None:
        """`at` [m] in the tool frame, which the object is turned as."""
        pose = compose(from_message(self.links[self.arm.tool_frame]), (at, (0.0, 0.0, 0.0, 1.0)))
        answer = self.edit(SceneAdd(object=SceneObject(name=name, shape=shape, pose=to_message(pose))))
        assert answer.accepted, answer.reason

    def named(self, name: str) -> SceneObject:
        return next(item for item in self.store.scene.objects if item.name == name)


@pytest.fixture(params=["rm1", "parol6"])
def cell(request: pytest.FixtureRequest) -> Cell:
    return Cell(request.param)


def test_closing_attaches_what_is_between_the_jaws_and_opening_leaves_it_where_it_is(cell: Cell) -> None:
    cell.add("part", BoxShape(size=(0.02, 0.02, 0.02)), (0.0, 0.0, MIDDLE))
    cell.add("table", BoxShape(size=(0.5, 0.5, 0.02)), (0.0, 0.0, MIDDLE + 0.021))
    before = cell.named("part").pose
    gripped = cell.edit(SceneGrip())
    assert (gripped.accepted, gripped.name) == (True, "part")
    assert gripped.width == pytest.approx(0.02)
    part = cell.named("part")
    assert (part.attached, part.gripped, part.frame) == (True, True, cell.arm.tool_frame)
    assert not cell.named("table").attached
    released = cell.edit(SceneRelease())
    assert released.name == "part"
    part = cell.named("part")
    assert (part.attached, part.gripped, part.frame, part.touch_links) == (False, False, "", ())
    assert part.pose.translation == pytest.approx(before.translation, abs=1e-12)


def test_looking_changes_nothing(cell: Cell) -> None:
    cell.add("part", SphereShape(radius=0.01), (0.0, 0.0, MIDDLE))
    scene = cell.store.scene
    assert cell.edit(SceneGrip(look=True)).name == "part"
    assert cell.store.scene is scene


@pytest.mark.parametrize(
    ("shape", "at"),
    [
        (BoxShape(size=(0.02, 0.02, 0.02)), (0.05, 0.0, MIDDLE)),  # beside the jaws
        (BoxShape(size=(0.02, 0.02, 0.02)), (0.0, 0.0, 0.06)),  # beyond them
        (BoxShape(size=(0.02, 0.2, 0.02)), (0.0, 0.0, MIDDLE)),  # too wide for them
        (PlaneShape(), (0.0, 0.0, MIDDLE)),
    ],
)
def test_what_the_jaws_cannot_hold_is_not_gripped(cell: Cell, shape: Shape, at: tuple[float, float, float]) -> None:
    cell.add("thing", shape, at)
    answer = cell.edit(SceneGrip())
    assert (answer.accepted, answer.name) == (True, "")
    assert not cell.named("thing").attached


def test_a_tool_that_a_person_has_attached_stays_when_the_gripper_opens(cell: Cell) -> None:
    item = SceneObject(
        name="camera", shape=BoxShape(size=(0.02, 0.02, 0.02)), frame=cell.arm.tool_frame, attached=True,
        pose=Transform(translation=(0.0, 0.05, -0.05)),
    )  # fmt: skip
    assert cell.edit(SceneAdd(object=item)).accepted
    assert cell.edit(SceneRelease()).name == ""
    assert cell.named("camera").attached


def test_without_a_gripper_or_a_place_it_says_so() -> None:
    cell = Cell("rm1")
    bare = SceneStore(replace(cell.arm, gripper=None))
    answer = bare.edit(SceneRequest(edit=SceneGrip()), lambda: cell.links, 1)
    assert answer.why == because("scene.grip.no_gripper", remedy("write_gripper"), robot="rm1")
    answer = cell.store.edit(SceneRequest(edit=SceneGrip()), lambda: None, 1)
    assert answer.why == because("scene.grip.arm_unknown", remedy("start_gateway"))
    assert answer.reason == str(answer.why)


@examples(quick=20, full=60)
@given(st.sampled_from(("box", "cylinder")), TURN, TURN, TURN)
def test_a_width_is_that_of_the_solid_s_corners(kind: str, roll: float, pitch: float, yaw: float) -> None:
    shape: Shape = BoxShape(size=(0.03, 0.02, 0.01)) if kind == "box" else CylinderShape(radius=0.01, length=0.04)
    pose: Rigid = ((0.1, 0.2, 0.3), from_rpy(roll, pitch, yaw))
    solid = shape_of(SceneObject(name="thing", shape=shape))
    if kind == "box":
        corners = np.array([[x, y, z] for x in (-0.015, 0.015) for y in (-0.01, 0.01) for z in (-0.005, 0.005)])
    else:
        rim = np.linspace(0.0, 2.0 * np.pi, 2001)
        corners = np.array([[0.01 * np.cos(a), 0.01 * np.sin(a), z] for a in rim for z in (-0.02, 0.02)])
    placed = np.array([compose(pose, (tuple(corner), (0.0, 0.0, 0.0, 1.0)))[0] for corner in corners])
    assert width_of(solid, pose) == pytest.approx(float(np.ptp(placed[:, 1])), abs=1e-6)


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_the_jaws_touch_what_is_beside_them_only_as_far_apart_as_they_are(name: str) -> None:
    arm, kinematics = ARMS[name], Kinematics(ARMS[name])
    configuration = arm.named_states["left"]
    gripper = arm.gripper
    assert gripper is not None
    beside = ((0.0, gripper.open / 2.0 + 0.003, MIDDLE), (0.0, 0.0, 0.0, 1.0))
    pose = compose(from_message(kinematics.link_poses(configuration)[arm.tool_frame]), beside)
    thing = SceneObject(name="thing", shape=SphereShape(radius=0.002), pose=to_message(pose))

    def touches(opening: float) -> bool:
        scene = PlanningScene(objects=(thing, *jaw_objects(arm, opening)))
        return bool(World(arm, kinematics, scene).contacts(configuration))

    assert touches(gripper.open)
    assert not touches(gripper.closed)
    assert not touches(gripper.open / 4.0)


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_the_jaws_touch_the_arm_in_no_named_state(name: str) -> None:
    arm, kinematics = ARMS[name], Kinematics(ARMS[name])
    assert arm.gripper is not None
    world = World(arm, kinematics, PlanningScene(objects=jaw_objects(arm, arm.gripper.open)))
    for state, configuration in arm.named_states.items():
        assert not list(world.contacts(configuration)), state


def test_the_jaws_are_taken_to_be_open_where_that_is_not_known_and_on_their_way() -> None:
    arm = ARMS["rm1"]
    assert jaws_apart(arm, None) == 0.05
    assert jaws_apart(arm, GripperState(known=False)) == 0.05
    assert jaws_apart(arm, GripperState(known=True, position=0.01, target=0.03)) == 0.01
    assert jaws_apart(arm, GripperState(known=True, position=0.01, target=0.03, moving=True)) == 0.03
    assert jaws_apart(arm, GripperState(known=True, position=-0.001)) == 0.0
    assert jaws_apart(arm, GripperState(known=True, position=1e308)) == 0.05
    assert jaws_apart(arm, GripperState(known=True, position=-1e308)) == 0.0
    assert jaw_objects(replace(arm, gripper=None), 0.05) == ()


def stand(asker: Node, arm: ArmDescription, opening: float) -> None:
    """The arm in its state "ready", its jaws so far apart; said often enough to be heard."""
    states, jaws = asker.publisher(JOINT_STATES), asker.publisher(GRIPPER_STATE)
    for _ in range(3):
        states.put(JointState(stamp=asker.now(), name=arm.joint_names, position=arm.named_states["ready"]))
        jaws.put(GripperState(stamp=asker.now(), known=True, position=opening, target=opening))
        asker.wait(0.05)


def test_the_planner_checks_the_jaws_at_their_opening_and_does_not_show_them_as_objects(tmp_path: Path) -> None:
    arm, kinematics = ARMS["rm1"], Kinematics(ARMS["rm1"])
    ready = arm.named_states["ready"]
    pose = compose(
        from_message(kinematics.link_poses(ready)[arm.tool_frame]), ((0.0, 0.028, MIDDLE), (0.0, 0.0, 0.0, 1.0))
    )
    thing = SceneObject(name="thing", shape=SphereShape(radius=0.002), pose=to_message(pose))
    here = ValidityRequest(name=arm.joint_names, position=ready)
    with beside_a_planner(tmp_path) as asker:
        scene = asker.latest(SCENE)
        assert edit(asker, SceneAdd(object=thing)).accepted
        stand(asker, arm, 0.0)
        assert asker.call(STATE_VALIDITY, here, timeout=60.0).code is PlanCode.SUCCESS
        version = scene.message.version if scene.message is not None else 0
        stand(asker, arm, 0.05)
        answer = asker.call(STATE_VALIDITY, here, timeout=60.0)
        assert answer.code is not PlanCode.SUCCESS
        assert {answer.contacts[0].first, answer.contacts[0].second} & set(JAWS)
        assert scene.message is not None
        assert scene.message.objects == (thing,)
        assert scene.message.version > version, "what was planned with closed jaws is of another scene"
        assert edit(asker, SceneRelease(opening=0.0)).accepted
        assert asker.call(STATE_VALIDITY, here, timeout=60.0).code is PlanCode.SUCCESS, "at once, before their state"
        assert edit(asker, SceneRelease(opening=0.05)).accepted
        assert asker.call(STATE_VALIDITY, here, timeout=60.0).code is not PlanCode.SUCCESS
        assert edit(asker, SceneAllow(pair=AllowedPair(first="thing", second=JAWS[0]))).accepted
        assert edit(asker, SceneAllow(pair=AllowedPair(first="thing", second=JAWS[1]))).accepted
        assert asker.call(STATE_VALIDITY, here, timeout=60.0).code is PlanCode.SUCCESS
        refused = edit(asker, SceneAdd(object=msgspec.structs.replace(thing, name=JAWS[0])))
        assert "is a jaw of the gripper" in str(refused.reason)
