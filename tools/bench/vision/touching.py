"""Mounting a camera by touching a printed board, as the wizard asks it of a person at rm1: rendered images of it,
and a hand that aims the tip to half a millimetre."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from msgspec.structs import replace

from gemelo.libraries.arm.cell.camera_model import exact_info
from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.reprojection import Carrier
from gemelo.libraries.vision.calibration.shots import one_of
from gemelo.libraries.vision.calibration.touches import TOUCH_SIGMA, fit_touches, spread_points
from gemelo.libraries.vision.camera_model import CameraModel, model_of
from gemelo.libraries.vision.rigid import Array, apply, from_transform, rigid
from gemelo.schemas.cell import CameraRecord, TagRecord, VirtualSource
from gemelo.schemas.joints import JointState
from gemelo.services.camera.virtual.virtual_camera import VirtualCamera
from gemelo.services.camera.virtual.world import CameraWorld
from gemelo.tools.bench.figures import Figure, of_samples, quantile
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.bench.vision.mounting import tool_error
from gemelo.tools.cli.camera.camera_mount import ENOUGH_TAGS, IMAGES, TOUCHES

# Four samples a side: with two the edges of a board that lies along the rows of the image are drawn 0.3 px off.
CAMERA = CameraRecord(
    name="overhead",
    source=VirtualSource(samples=4),
    position=(0.54, 0.0, 0.62),
    look_at=(0.27, 0.0, 0.1),
    field_of_view=1.15,
)
BOARD = TagBoard(first=200)
VIEWS, HANDS = 6, 10  # places of the board, and people who touch it there
FEW = 4
MOST = 0.5  # [mm]
ROUNDS = 20  # of Newton's method


@dataclass(frozen=True)
class BoardScene:
    """The board at one place before the camera."""

    base_from_board: Array  # (4, 4)
    base_from_camera: Array  # (4, 4)
    model: CameraModel
    seen: tuple[Sighting, ...]  # one for each image


def mount_touch_mm() -> Figure:
    """Error at what the camera sees by where `gemelo camera mount` says that it stands [mm], from touched corners."""
    arm = rm1()
    scenes = [scene_of(arm, np.random.default_rng(seed)) for seed in range(VIEWS)]
    ours = errors(scenes, TOUCHES, IMAGES)
    reference = {
        "4 touches, one image, median": quantile(errors(scenes, FEW, 1), 0.5),
        "4 touches, median": quantile(errors(scenes, FEW, IMAGES), 0.5),
        "tip at the nearest whole step, not said how far beside, median": quantile(
            errors(scenes, TOUCHES, IMAGES, arm), 0.5
        ),
    }
    note = f"{TOUCHES} touches, each +-{1e3 * TOUCH_SIGMA:g} mm along every axis, {IMAGES} images of 640 x 480"
    figure = of_samples(ours, reference=reference, note=f"{note}; p95 {quantile(ours, 0.95):.3g}")
    return replace(figure, goal=f"median <= {MOST:g}", met=quantile(ours, 0.5) <= MOST)


def scene_of(arm: ArmDescription, random: np.random.Generator) -> BoardScene:
    """The board flat within the arm's reach, and the arm aside."""
    place = np.array([random.uniform(0.24, 0.3), random.uniform(-0.08, 0.08), 0.002])
    yaw = float(random.uniform(-0.6, 0.6))
    board = rigid(np.array([0.0, 0.0, yaw]), place)
    tags = tuple(
        TagRecord(id=number, size=BOARD.tag, position=_triple(apply(board, centre[None])[0]), rpy=(0.0, 0.0, yaw))
        for number, centre in BOARD.centres().items()
    )
    world, info = CameraWorld(arm, Cell(Path(), cameras=(CAMERA,), tags=tags)), exact_info(CAMERA, arm.base_frame)
    world.on_joint_state(JointState(stamp=1, name=arm.joint_names, position=arm.named_states["folded"]))
    assert isinstance(CAMERA.source, VirtualSource)
    camera, model = VirtualCamera(CAMERA, CAMERA.source, info, world.snapshot), model_of(info)
    seen = []
    for _ in range(IMAGES):
        image = np.ascontiguousarray(camera.image(world.snapshot()))
        found = BOARD.find(np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8), model)
        assert found is not None
        seen.append(found)
    return BoardScene(board, from_transform(info.parent_from_camera), model, tuple(seen))


def errors(scenes: list[BoardScene], count: int, images: int, stepping: ArmDescription | None = None) -> list[float]:
    """[mm] of `HANDS` people in each scene. `stepping`: the arm, if its tip stands beside the points at whole steps."""
    points = BOARD.points()[spread_points(list(BOARD.points()), count)]
    off = []
    for scene in scenes:
        sighting = one_of(scene.seen[:images], 4 * ENOUGH_TAGS)
        at = apply(scene.base_from_board, points)
        tips = at if stepping is None else np.array([at_whole_steps(stepping, point) for point in at])
        for hand in range(HANDS):
            touched = tips + np.random.default_rng(hand).normal(0.0, TOUCH_SIGMA, tips.shape)
            fit = fit_touches(points, touched, sighting, scene.model)
            off.append(tool_error(fit.base_from_camera, scene.base_from_camera, Carrier.BOARD))
    return off


def at_whole_steps(arm: ArmDescription, point: Array) -> Array:
    """(3,) [m] where the tool of an arm of three joints stands that is led to `point`, at the nearest whole step of
    each joint."""
    kinematics = Kinematics(arm)
    joints = np.array(arm.named_states["ready"])
    for _ in range(ROUNDS):
        apart = point - np.array(kinematics.tool(joints).position)
        joints = joints + np.linalg.lstsq(kinematics.jacobian(joints)[:3], apart, rcond=None)[0]
    steps = np.array([joint.steps.per_unit for joint in arm.joints])
    return np.array(kinematics.tool(np.round(joints * steps) / steps).position)


def _triple(point: Array) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z
