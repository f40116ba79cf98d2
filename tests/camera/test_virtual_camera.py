"""The virtual camera's world: the arm and what it carries, and the truth that a detector is judged by."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.cell.camera_model import exact_info
from gemelo.libraries.arm.cell.cell_file import Cell, grasp_width, load_cell
from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, compose, from_rpy, inverse
from gemelo.libraries.arm.kinematics.chain import link_transforms
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.camera import CameraInfo
from gemelo.schemas.cell import VirtualSource
from gemelo.schemas.frames import Transform
from gemelo.schemas.gripper import GripperState
from gemelo.schemas.joints import JointState
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.camera.virtual.virtual_camera import (
    VirtualCamera,
    base_from_camera,
    outline,
    projected,
    true_detections,
)
from gemelo.services.camera.virtual.world import CameraWorld


@pytest.fixture(params=["rm1", "parol6"])
def arm(request: pytest.FixtureRequest, rm1_folder: Path) -> ArmDescription:
    return load_arm(rm1_folder.parent / request.param)


@pytest.fixture
def cell(arm: ArmDescription) -> Cell:
    return load_cell(arm.folder / "cell.toml", arm)


@pytest.fixture
def world(arm: ArmDescription, cell: Cell) -> CameraWorld:
    return CameraWorld(arm, cell)


def stand(world: CameraWorld, arm: ArmDescription, name: str, stamp: int = 1) -> dict[str, Rigid]:
    """The arm in a named state; the true pose of every link."""
    values = arm.named_states[name]
    world.on_joint_state(JointState(stamp=stamp, name=arm.joint_names, position=values))
    return link_transforms(arm.model, dict(zip(arm.joint_names, values, strict=True)))


def image_of(cell: Cell, world: CameraWorld, arm: ArmDescription) -> tuple[np.ndarray, CameraInfo]:
    record = cell.camera("overhead")
    assert isinstance(record.source, VirtualSource)
    info = exact_info(record, arm.base_frame)
    return VirtualCamera(record, record.source, info, world.snapshot).image(world.snapshot()), info


def tags_in(image: np.ndarray) -> dict[int, np.ndarray]:
    """Corners (4, 2) [px] by number."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36H11)
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary).detectMarkers(image)
    return (
        {} if numbers is None else dict(zip(numbers.ravel().tolist(), [c.reshape(4, 2) for c in corners], strict=True))
    )


def test_the_tags_of_the_sample_cell_are_found_where_the_truth_has_them(
    arm: ArmDescription, cell: Cell, world: CameraWorld
) -> None:
    stand(world, arm, "left")
    image, info = image_of(cell, world, arm)
    found = tags_in(image)
    assert {100, 101} <= set(found)
    truth = {
        item.name: item for item in true_detections(world.snapshot(), info, {t.name: t for t in cell.things}).items
    }
    stand(world, arm, "right")
    image, info = image_of(cell, world, arm)
    assert np.abs(tags_in(image)[1] - np.array(truth["cup"].corners)).max() < 2.0


def test_the_jaws_carry_a_thing_and_let_it_fall_upright_onto_the_table(
    arm: ArmDescription, cell: Cell, world: CameraWorld
) -> None:
    links = stand(world, arm, "ready")
    tool = links[arm.tool_frame]
    cup = cell.thing("cup")
    assert arm.gripper is not None
    grip_point = compose(tool, ((0.001, 0.004, 0.008), from_rpy(np.pi, 0.0, 0.2)))
    pose = compose(grip_point, inverse((cup.grasp_offset, IDENTITY[1])))
    world.put("cup", pose)
    for opening in (arm.gripper.open, 0.039, grasp_width(cup)):
        world.on_gripper_state(GripperState(known=True, position=opening))
    held = world.snapshot().things["cup"]
    grasped = compose(inverse(tool), compose(held, (cup.grasp_offset, IDENTITY[1])))
    assert grasped[0] == pytest.approx((0.001, 0.0, 0.008), abs=1e-9)  # the jaws have centred it
    moved = stand(world, arm, "left")[arm.tool_frame]
    carried = world.snapshot().things["cup"]
    assert compose(inverse(moved), carried)[0] == pytest.approx(compose(inverse(tool), held)[0], abs=1e-9)
    world.on_gripper_state(GripperState(known=True, position=arm.gripper.open))
    fallen = world.snapshot().things["cup"]
    assert fallen[0] == pytest.approx((carried[0][0], carried[0][1], 0.04), abs=1e-9)
    assert fallen[1][:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    stand(world, arm, "ready")
    assert world.snapshot().things["cup"] == fallen


@pytest.mark.parametrize("offset", [(0.02, 0.0, 0.008), (0.0, 0.03, 0.008), (0.0, 0.0, 0.05)])
def test_jaws_that_close_beside_a_thing_do_not_hold_it(
    arm: ArmDescription, cell: Cell, world: CameraWorld, offset: tuple[float, float, float]
) -> None:
    tool = stand(world, arm, "ready")[arm.tool_frame]
    there = compose(tool, (offset, IDENTITY[1]))
    world.put("red_block", there)
    assert arm.gripper is not None
    for opening in (arm.gripper.open, 0.0):
        world.on_gripper_state(GripperState(known=True, position=opening))
    stand(world, arm, "left")
    assert world.snapshot().things["red_block"] == there


@pytest.mark.parametrize(("turn", "side"), [(0.2, 0.026), (1.4, 0.034), (-1.7, 0.034), (3.0, 0.026)])
def test_jaws_are_as_far_apart_as_the_side_that_is_between_them(
    arm: ArmDescription, cell: Cell, turn: float, side: float
) -> None:
    """They close along the tool's y, on the longer side too."""
    block = replace(next(each for each in cell.things if each.name == "red_block"), box=(0.034, 0.026, 0.03))
    world = CameraWorld(arm, Cell(cell.path, things=(block,), table=cell.table))
    tool = stand(world, arm, "ready")[arm.tool_frame]
    world.put("red_block", compose(tool, ((0.0, 0.0, 0.008), from_rpy(np.pi, 0.0, turn))))
    assert arm.gripper is not None
    for opening in (arm.gripper.open, side + 0.003, side):
        world.on_gripper_state(GripperState(known=True, position=opening))
    before = world.snapshot().things["red_block"]
    stand(world, arm, "left")
    assert world.snapshot().things["red_block"] != before
    world.on_gripper_state(GripperState(known=True, position=side + 0.003))
    fallen = world.snapshot().things["red_block"]
    stand(world, arm, "ready")
    assert world.snapshot().things["red_block"] == fallen


def test_closed_jaws_that_come_upon_a_thing_do_not_hold_it(arm: ArmDescription, cell: Cell, world: CameraWorld) -> None:
    tool = stand(world, arm, "ready")[arm.tool_frame]
    world.on_gripper_state(GripperState(known=True, position=0.0))
    there = compose(tool, ((0.0, 0.0, 0.008), IDENTITY[1]))
    world.put("red_block", there)
    world.on_gripper_state(GripperState(known=True, position=0.0))
    stand(world, arm, "left")
    assert world.snapshot().things["red_block"] == there


def test_obstacles_of_the_scene_are_seen_but_never_what_is_believed_of_a_thing(
    arm: ArmDescription, cell: Cell, world: CameraWorld
) -> None:
    stand(world, arm, "left")
    before, info = image_of(cell, world, arm)
    at = Transform(translation=(0.3, -0.2, 0.05))
    believed = SceneObject(name="cup", shape=BoxShape(size=(0.1, 0.1, 0.1)), pose=at)
    world.on_scene(PlanningScene(version=1, objects=(believed,)))
    after, _ = image_of(cell, world, arm)
    assert np.array_equal(before, after)
    world.on_scene(PlanningScene(version=2, objects=(SceneObject(name="post", shape=believed.shape, pose=at),)))
    with_post, _ = image_of(cell, world, arm)
    there: Rigid = ((0.3, -0.2, 0.05), IDENTITY[1])
    local = compose(inverse(base_from_camera(info, world.snapshot().links)), there)
    u, v = projected(((0.0, 0.0, 0.0),), local, info)[0]
    change = np.abs(with_post.astype(int) - before.astype(int)).max(axis=2) > 25
    rows, columns = np.nonzero(change)
    assert abs(columns.mean() - u) < 15
    assert abs(rows.mean() - v) < 15


def test_the_arm_hides_a_tag_below_it(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder)
    cell = load_cell(rm1_folder / "cell.toml", arm)
    world = CameraWorld(arm, cell)
    stand(world, arm, "left")
    world.put("cup", ((0.25, 0.0, 0.04), IDENTITY[1]))
    assert 1 in tags_in(image_of(cell, world, arm)[0])
    stand(world, arm, "home")  # stretched out above it
    assert 1 not in tags_in(image_of(cell, world, arm)[0])


def test_a_camera_on_a_link_moves_with_it(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder)
    info = CameraInfo(parent="efector_link", parent_from_camera=Transform(translation=(0.05, 0.0, -0.1)))
    world = CameraWorld(arm, Cell(Path()))
    for name in ("ready", "left"):
        links = stand(world, arm, name)
        expected = compose(links["efector_link"], ((0.05, 0.0, -0.1), IDENTITY[1]))
        assert base_from_camera(info, world.snapshot().links)[0] == pytest.approx(expected[0])


def test_a_world_that_stands_still_is_drawn_once_and_its_noise_every_time(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder)
    cell = load_cell(rm1_folder / "cell.toml", arm)
    world = CameraWorld(arm, cell)
    record = cell.camera("overhead")
    assert isinstance(record.source, VirtualSource)
    camera = VirtualCamera(record, record.source, exact_info(record, arm.base_frame), world.snapshot)
    stand(world, arm, "left")
    first, second = camera.image(world.snapshot()), camera.image(world.snapshot())
    assert (first != second).any()
    calm = camera.calm
    stand(world, arm, "left", stamp=2)
    camera.image(world.snapshot())
    assert camera.calm is calm
    stand(world, arm, "right")
    camera.image(world.snapshot())
    assert camera.calm is not calm


def test_the_stamp_of_an_image_is_that_of_the_joints_it_shows(rm1_folder: Path) -> None:
    import time

    arm = load_arm(rm1_folder)
    cell = load_cell(rm1_folder / "cell.toml", arm)
    world = CameraWorld(arm, cell)
    record = cell.camera("overhead")
    assert isinstance(record.source, VirtualSource)
    camera = VirtualCamera(record, record.source, exact_info(record, arm.base_frame), world.snapshot)
    now = time.time_ns()
    stand(world, arm, "left", stamp=now)
    assert camera.read().stamp == now
    stand(world, arm, "left", stamp=now - 10_000_000_000)
    assert camera.read().stamp >= now  # of an arm that says nothing the time is that of drawing


def test_the_outline_of_a_thing_begins_at_the_top_left(rm1_folder: Path) -> None:
    arm = load_arm(rm1_folder)
    cell = load_cell(rm1_folder / "cell.toml", arm)
    assert outline(cell.thing("cup"))[0] == (-0.014, 0.014, 0.0)
    assert outline(cell.thing("red_block"))[2] == (0.015, -0.015, 0.015)
