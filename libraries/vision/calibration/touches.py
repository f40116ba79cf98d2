"""The pose of a camera from points of a printed board that the arm's tool has touched: for arms that cannot tilt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array, apply, from_opencv, inverse, rigid
from gemelo.schemas.reasons import because

FEWEST_TOUCHES = 4
TOUCH_SIGMA = 0.0005  # [m] of a touch that a person has aimed
LARGEST_TURN_SIGMA = np.radians(0.5)
OUTLIER_AT, LEAST_OUTLIER = 4.0, 0.002  # times the median error of the others, and [m] at least


@dataclass(frozen=True)
class TouchFit:
    """Where the camera stands in the base."""

    base_from_camera: Array  # (4, 4)
    base_from_board: Array  # (4, 4)
    held_out: float  # [m] median distance of a touch from where the others put it
    errors: tuple[float, ...]  # [m] of each touch
    outliers: tuple[int, ...]  # touches that do not agree with the others, counted from 0


def fit_touches(board: Array, touched: Array, sighting: Sighting, model: CameraModel) -> TouchFit:
    """The camera's pose in the base from points `board` (n, 3) [m] of a board that lies flat, where the tool `touched`
    them (n, 3) [m] in the base, and one image of it. NotMeasured where the touches do not determine it."""
    refuse_touches(board)
    kept = np.ones(len(board), dtype=bool)
    left_out = _left_out(board, touched)
    limit = max(LEAST_OUTLIER, OUTLIER_AT * float(np.median(left_out)))
    worst = int(np.argmax(left_out))
    if left_out[worst] > limit and len(board) > FEWEST_TOUCHES:
        kept[worst] = False
    base_from_board = flat_registration(board[kept], touched[kept])
    errors = np.linalg.norm(apply(base_from_board, board) - touched, axis=1)
    base_from_camera = base_from_board @ inverse(board_in_camera(sighting, model))
    held_out = float(np.median(_left_out(board[kept], touched[kept])))
    outliers = tuple(int(index) for index in np.flatnonzero(~kept))
    return TouchFit(base_from_camera, base_from_board, held_out, tuple(float(e) for e in errors), outliers)


def refuse_touches(board: Array) -> None:
    """NotMeasured where points `board` (n, 3) [m] cannot determine the board, however well they are touched."""
    if len(board) < FEWEST_TOUCHES:
        raise NotMeasured(because("measure.touches.few", count=len(board), least=FEWEST_TOUCHES))
    spread = float(np.sqrt(np.sum((board[:, :2] - board[:, :2].mean(axis=0)) ** 2)))
    turn_sigma = TOUCH_SIGMA / max(spread, 1e-9)
    if turn_sigma > LARGEST_TURN_SIGMA:
        degrees = {"sigma": float(np.degrees(turn_sigma)), "most": float(np.degrees(LARGEST_TURN_SIGMA))}
        raise NotMeasured(because("measure.touches.near", count=len(board), **degrees))


def flat_registration(board: Array, touched: Array) -> Array:
    """base_from_board (4, 4) of a board that lies flat: x, y, height and the turn about the vertical, by least squares
    from its points `board` (n, 3) [m] to where the tool `touched` them, (n, 3) [m]."""
    middle, centre = board.mean(axis=0), touched.mean(axis=0)
    a, b = board[:, :2] - middle[:2], touched[:, :2] - centre[:2]
    angle = np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b))
    pose = rigid(np.array([0.0, 0.0, angle]), np.zeros(3))
    pose[:3, 3] = centre - pose[:3, :3] @ middle
    return pose


def _left_out(board: Array, touched: Array) -> Array:
    """[m] between each touch and where the others put it."""
    found = []
    for index in range(len(board)):
        rest = np.arange(len(board)) != index
        pose = flat_registration(board[rest], touched[rest])
        found.append(float(np.linalg.norm(apply(pose, board[index : index + 1])[0] - touched[index])))
    return np.array(found)


def board_in_camera(sighting: Sighting, model: CameraModel) -> Array:
    """camera_from_board (4, 4) of one image."""
    ideal = model.ideal(sighting.pixels)
    solved = cv2.solvePnPGeneric(sighting.points, ideal, model.matrix, None, flags=cv2.SOLVEPNP_IPPE)
    turned, place = cv2.solvePnPRefineLM(sighting.points, ideal, model.matrix, None, solved[1][0], solved[2][0])
    return from_opencv(turned, place)


def spread_points(corners: Sequence[Array], count: int) -> list[int]:
    """Which `count` of the points (3,) [m] to touch: those that lie farthest from one another, the first one first."""
    chosen = [0]
    places = np.array(corners)
    while len(chosen) < min(count, len(places)):
        nearest = np.min(np.linalg.norm(places[:, None] - places[chosen][None], axis=2), axis=1)
        chosen.append(int(np.argmax(nearest)))
    return chosen
