"""Ground truth for mounting a camera: both arms in poses where it sees a board, with every kind of error."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.vision.boards import Sighting, TagBoard
from gemelo.libraries.vision.calibration.reprojection import BoardView, Carrier
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, apply, inverse, rigid, step, turn


@dataclass(frozen=True)
class MountingTrial:
    """Views of a board, and the truth."""

    views: list[BoardView]
    parent_from_camera: Array
    carrier_from_board: Array


def looking(position: Array, at: Array) -> Array:
    """The pose (4, 4) of a camera at `position` that looks at a point, its x level."""
    forward = (at - position) / np.linalg.norm(at - position)
    right = np.cross(forward, np.array([0.0, 0.0, 1.0]))
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-6 else np.array([0.0, -1.0, 0.0])
    return rigid(np.stack((right, np.cross(forward, right), forward), axis=1), position)


def six_joint_trial(
    model: CameraModel, carrier: Carrier, board: TagBoard, count: int, random: np.random.Generator,
    noise: float = 0.3, arm_error: float = 0.0, tilt: float = np.radians(30.0),
) -> MountingTrial:  # fmt: skip
    """Poses of a tool that tilts freely by up to `tilt` [rad]; `noise` [px], `arm_error` 1 is 0.5 mm and 2 mrad."""
    points = board.points()
    if carrier is Carrier.CAMERA:
        camera = rigid(np.array([0.02, -0.03, 0.4]), np.array([0.03, -0.02, 0.04]))
        carried = rigid(np.array([0.0, 0.0, 0.3]), np.array([0.3, 0.05, 0.0]))
    else:
        camera = looking(np.array([0.7, -0.25, 0.45]), np.array([0.3, 0.0, 0.25]))
        carried = rigid(np.array([0.05, -0.04, 0.3]), np.array([0.01, 0.005, 0.03]))
    views: list[BoardView] = []
    while len(views) < count:
        pose = _drawn(carrier, camera, carried, tilt, random)
        seen = inverse(camera) @ (pose @ carried if carrier is Carrier.BOARD else inverse(pose) @ carried)
        _add(views, model, points, seen, pose, noise, arm_error, random)
    return MountingTrial(views, camera, carried)


def _drawn(carrier: Carrier, camera: Array, board: Array, tilt: float, random: np.random.Generator) -> Array:
    """base_from_link in which the camera sees the board tilted by up to `tilt`."""
    facing = turn(np.array([np.pi, 0.0, 0.0])) @ turn(np.append(random.uniform(-tilt, tilt, 2), random.uniform(-1, 1)))
    place = np.append(random.uniform(-0.07, 0.07, 2), random.uniform(0.3, 0.5))
    camera_from_board = rigid(facing, place)
    if carrier is Carrier.BOARD:
        return camera @ camera_from_board @ inverse(board)
    return board @ inverse(camera_from_board) @ inverse(camera)


def _add(
    views: list[BoardView], model: CameraModel, points: Array, seen: Array, pose: Array, noise: float, arm_error: float,
    random: np.random.Generator,
) -> None:  # fmt: skip
    placed = apply(seen, points)
    if placed[:, 2].min() < 0.05:
        return
    pixels = model.project(placed)
    if pixels.min() < 0.0 or (pixels > (model.width, model.height)).any():
        return
    pixels = pixels + random.normal(0.0, noise, pixels.shape)
    error = step(np.concatenate((random.normal(0.0, 0.002, 3), random.normal(0.0, 0.0005, 3))) * arm_error)
    views.append(BoardView(pose @ error, Sighting(points, pixels, max(noise, 0.02))))


def level_trial(
    arm: ArmDescription, model: CameraModel, board: TagBoard, count: int, random: np.random.Generator,
    noise: float = 0.3, joint_noise: float = 0.0,
) -> MountingTrial:  # fmt: skip
    """Poses of rm1, which cannot tilt its tool: the camera stands, the board is on the tool and looks up.

    `noise` [pixels] of each corner, `joint_noise` [rad] of each joint.
    """
    kinematics = Kinematics(arm)
    points = board.points()
    camera = looking(np.array([0.62, -0.3, 0.62]), np.array([0.25, 0.0, 0.1]))
    carried = rigid(np.array([np.pi, 0.0, 0.0]), np.array([0.012, -0.008, -0.04]))
    views: list[BoardView] = []
    lower, upper = (np.array([getattr(joint, side) for joint in arm.joints]) for side in ("lower", "upper"))
    while len(views) < count:
        joints = random.uniform(np.maximum(lower, -1.6), np.minimum(upper, 1.6))
        pose, said = (kinematics.tool(q) for q in (joints + random.normal(0.0, joint_noise, 3) * (1, 1, 0), joints))
        true = rigid(pose.rotation, pose.position)
        before = len(views)
        _add(
            views,
            model,
            points,
            inverse(camera) @ true @ carried,
            rigid(said.rotation, said.position),
            noise,
            0,
            random,
        )
        if len(views) > before and (inverse(camera) @ true @ carried)[2, 2] > -0.3:
            views.pop()
    return MountingTrial(views, camera, carried)


def tool_error(found: Array, truth: Array, carrier: Carrier) -> float:
    """[mm] median by which points that the camera sees at 0.3 to 0.5 m are placed wrongly; `found` and `truth` (4, 4)
    are parent_from_camera."""
    seen = np.array([[x, y, z] for x in (-0.08, 0.0, 0.08) for y in (-0.06, 0.0, 0.06) for z in (0.3, 0.4, 0.5)])
    return 1000.0 * float(np.median(np.linalg.norm(apply(found, seen) - apply(truth, seen), axis=1)))


def closed_form(trial: MountingTrial, model: CameraModel, carrier: Carrier, method: int) -> Array | None:
    """parent_from_camera (4, 4) by one of OpenCV's methods; None where it gives none."""
    poses = [v.base_from_link if carrier is Carrier.CAMERA else inverse(v.base_from_link) for v in trial.views]
    boards = []
    for view in trial.views:
        solved = cv2.solvePnPGeneric(
            view.sighting.points, view.sighting.pixels, model.matrix, model.distortion, flags=cv2.SOLVEPNP_IPPE
        )
        boards.append(rigid(np.asarray(solved[1][0])[:, 0], np.asarray(solved[2][0])[:, 0]))
    try:
        turned, place = cv2.calibrateHandEye(
            [p[:3, :3] for p in poses], [p[:3, 3] for p in poses], [b[:3, :3] for b in boards],
            [b[:3, 3] for b in boards], method=method,
        )  # fmt: skip
    except cv2.error:
        return None
    if not np.isfinite(turned).all():
        return None
    return rigid(np.asarray(turned, dtype=np.float64), np.asarray(place, dtype=np.float64)[:, 0])
