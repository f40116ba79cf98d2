"""Least squares on the pixels of a board in several poses of an arm.

Either the camera stands and the board moves with a link, or the camera moves with a link and the board stands. Both are
one equation: camera_from_point = inverse(X) G N Y point, where X is the camera in its parent, Y the board in what
carries it, G what the arm's joints say, and N a small error of the arm in that pose, with a prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, apply, inverse
from gemelo.libraries.vision.tag_pose import moved

ROUNDS = 60
ARM_SIGMA = np.array([0.002] * 3 + [0.0005] * 3)  # [rad], [m] prior of the arm's error in a pose
FAR = 0.5  # [m] from what carries it a board is not much farther, which matters only to what is undetermined
KNOWN_SIGMA = 0.0002  # [m] of a height that was measured by hand
KNOWN = 12  # unknowns that are looked for; the arm's errors come after them
TOGETHER = 3.0  # standard deviations from which on a residual counts less (Huber)


class Carrier(Enum):
    """What the arm moves."""

    CAMERA = "camera"  # it rides on a link, the board stands
    BOARD = "board"  # it rides on a link, the camera stands


@dataclass(frozen=True)
class BoardView:
    """A board in an image while the arm stands in one pose."""

    base_from_link: Array  # (4, 4) of the link that carries the board or the camera
    sighting: Sighting


@dataclass(frozen=True)
class Reprojection:
    """All that is measured."""

    views: tuple[BoardView, ...]
    model: CameraModel
    carrier: Carrier
    height: float | None = None  # [m] of the board along z of what carries it, where that was measured
    ideal: tuple[Array, ...] = field(default=())  # (n, 2) [px] of each view without distortion

    def motion(self, index: int) -> Array:
        """G (4, 4) of a view."""
        pose = self.views[index].base_from_link
        return pose if self.carrier is Carrier.BOARD else inverse(pose)

    def part(self, chosen: Sequence[int]) -> Reprojection:
        """Of some of the views."""
        views = tuple(self.views[index] for index in chosen)
        return replace(self, views=views, ideal=tuple(self.ideal[index] for index in chosen))


@dataclass(frozen=True)
class CalibrationState:
    """What is looked for: X, Y and the arm's error in each view."""

    camera: Array  # (4, 4) X
    board: Array  # (4, 4) Y
    arm: tuple[Array, ...]  # (4, 4) N of each view

    def part(self, chosen: Sequence[int]) -> CalibrationState:
        """Of some of the views."""
        return CalibrationState(self.camera, self.board, tuple(self.arm[index] for index in chosen))


def problem_of(
    views: Sequence[BoardView], model: CameraModel, carrier: Carrier, height: float | None = None
) -> Reprojection:
    """The problem of these views, with the `height` [m] of the board where it is known."""
    ideal = tuple(model.ideal(view.sighting.pixels) for view in views)
    return Reprojection(tuple(views), model, carrier, height, ideal)


def exact_arm(camera: Array, board: Array, count: int) -> CalibrationState:
    """Of an arm that is where its joints say, in `count` views; camera and board (4, 4)."""
    return CalibrationState(camera, board, (np.eye(4),) * count)


def placed(problem: Reprojection, state: CalibrationState, index: int) -> Array:
    """The board's points (n, 3) of a view in the camera's frame."""
    chain = inverse(state.camera) @ problem.motion(index) @ state.arm[index] @ state.board
    return apply(chain, problem.views[index].sighting.points)


def reprojected(problem: Reprojection, state: CalibrationState, index: int) -> tuple[Array, Array]:
    """Where (n, 2) [px] the points of a view lie without distortion, and how far away (n,) [m] they are."""
    found = placed(problem, state, index)
    return found[:, :2] / found[:, 2:] * problem.model.focal + problem.model.centre, found[:, 2]


def residuals(problem: Reprojection, state: CalibrationState) -> Array:
    """(2 n views + 6 views + 3 or 4,) all that is off, each in its own standard deviations, so dimensionless: pixels,
    the arm's errors, the board's place."""
    parts = []
    for index, view in enumerate(problem.views):
        seen = reprojected(problem, state, index)[0]
        parts.append(((seen - problem.ideal[index]) / view.sighting.sigma).ravel())
    parts += [_small(arm) / ARM_SIGMA for arm in state.arm]
    parts.append(state.board[:3, 3] / FAR)
    if problem.height is not None:
        parts.append(np.array([(state.board[2, 3] - problem.height) / KNOWN_SIGMA]))
    return np.concatenate(parts)


def _small(pose: Array) -> Array:
    """The turn and the step (6,) of a small transform."""
    turned = pose[:3, :3]
    cross = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    return np.concatenate((cross / 2.0, pose[:3, 3]))


def cost_of(problem: Reprojection, state: CalibrationState) -> float:
    """Half the sum of the squared `residuals`, dimensionless, large ones counted less (Huber)."""
    off = np.abs(residuals(problem, state))
    cost = float(np.sum(np.where(off < TOGETHER, off**2 / 2.0, TOGETHER * (off - TOGETHER / 2.0))))
    in_front = all(placed(problem, state, index)[:, 2].min() > 0.0 for index in range(len(problem.views)))
    return cost if in_front else cost + 1e12


def point_slopes(problem: Reprojection, state: CalibrationState, index: int) -> tuple[Array, Array]:
    """Of the residuals (2 n,) of one view, by how its points (n, 2, 3) move in the camera's frame, and that frame's
    turn (3, 3) from the frame in which the arm is off."""
    found = placed(problem, state, index)
    z = found[:, 2]
    by_point = np.zeros((len(found), 2, 3))
    by_point[:, 0, 0], by_point[:, 1, 1] = 1.0 / z, 1.0 / z
    by_point[:, 0, 2], by_point[:, 1, 2] = -found[:, 0] / z**2, -found[:, 1] / z**2
    by_point *= problem.model.focal[:, None] / problem.views[index].sighting.sigma
    return by_point, state.camera[:3, :3].T @ problem.motion(index)[:3, :3]


def view_slopes(problem: Reprojection, state: CalibrationState, index: int) -> tuple[Array, Array]:
    """Of the residuals (2 n,) of one view, by the unknowns: (2 n, 12) the camera's turn and step in its parent and the
    board's in its carrier, (2 n, 6) the arm's in this view."""
    by_point, through = point_slopes(problem, state, index)
    on_board = apply(state.board, problem.views[index].sighting.points)
    carried = apply(state.arm[index], on_board)
    in_parent = apply(problem.motion(index), carried)
    by_arm = by_point @ through
    by_camera = -by_point @ state.camera[:3, :3].T @ _by_motion(in_parent - state.camera[:3, 3])
    by_board = by_arm @ state.arm[index][:3, :3] @ _by_motion(on_board - state.board[:3, 3])
    by_error = by_arm @ _by_motion(carried - state.arm[index][:3, 3])
    known = np.concatenate((by_camera, by_board), axis=2)
    return known.reshape(-1, KNOWN), by_error.reshape(-1, 6)


def jacobian(problem: Reprojection, state: CalibrationState) -> Array:
    """(residuals, 12 + 6 views) of `residuals` by the unknowns of `view_slopes`, the arm's errors view by view."""
    count = len(problem.views)
    rows = []
    for index in range(count):
        known, arm = view_slopes(problem, state, index)
        block = np.zeros((len(known), KNOWN + 6 * count))
        block[:, :KNOWN] = known
        block[:, KNOWN + 6 * index : KNOWN + 6 + 6 * index] = arm
        rows.append(block)
    prior = np.zeros((6 * count, KNOWN + 6 * count))
    prior[:, KNOWN:] = np.diag(np.tile(1.0 / ARM_SIGMA, count))
    priors = prior_slopes(problem)
    return np.vstack((*rows, prior, np.hstack((priors, np.zeros((len(priors), 6 * count))))))


def prior_slopes(problem: Reprojection) -> Array:
    """(k, 12), k = 3 or 4, of what is known of the board's place without any image, by the unknowns."""
    rows = np.zeros((3 if problem.height is None else 4, KNOWN))
    rows[:3, 9:12] = np.eye(3) / FAR
    if problem.height is not None:
        rows[3, 11] = 1.0 / KNOWN_SIGMA
    return rows


def _by_motion(points: Array) -> Array:
    """(n, 3, 6): how points (n, 3) move with a turn about the origin and a step."""
    found = np.zeros((len(points), 3, 6))
    x, y, z = points.T
    found[:, 0, 1], found[:, 1, 0] = z, -z
    found[:, 1, 2], found[:, 2, 1] = x, -x
    found[:, 2, 0], found[:, 0, 2] = y, -y
    found[:, :, 3:] = np.eye(3)
    return found


def solve(problem: Reprojection, state: CalibrationState, rounds: int = ROUNDS) -> CalibrationState:
    """Levenberg and Marquardt with Huber's weights from `state`."""
    damping, cost = 1e-4, cost_of(problem, state)
    for _ in range(rounds):
        off = residuals(problem, state)
        weights = np.sqrt(np.minimum(1.0, TOGETHER / np.maximum(np.abs(off), 1e-9)))
        slope = jacobian(problem, state) * weights[:, None]
        normal, gradient = slope.T @ slope, slope.T @ (off * weights)
        scaled = normal + damping * np.diag(np.diag(normal)) + 1e-9 * np.eye(len(normal))
        candidate = _stepped(state, np.asarray(-np.linalg.solve(scaled, gradient), dtype=np.float64))
        now = cost_of(problem, candidate)
        if now < cost:
            is_done = cost - now < 1e-8 * cost
            state, cost, damping = candidate, now, max(damping / 10.0, 1e-12)
            if is_done:
                break
        else:
            damping *= 10.0
            if damping > 1e8:
                break
    return state


def _stepped(state: CalibrationState, change: Array) -> CalibrationState:
    arm = tuple(moved(pose, change[KNOWN + 6 * i : KNOWN + 6 + 6 * i]) for i, pose in enumerate(state.arm))
    return CalibrationState(moved(state.camera, change[:6]), moved(state.board, change[6:KNOWN]), arm)


def errors_of(problem: Reprojection, camera: Array, board: Array) -> Array:
    """(views,) [m] at the board, each view as the arm's joints say: the median of its points across the line of sight;
    `camera` and `board` (4, 4)."""
    exact = exact_arm(camera, board, len(problem.views))
    found = []
    for index in range(len(problem.views)):
        seen, away = reprojected(problem, exact, index)
        off = np.linalg.norm(seen - problem.ideal[index], axis=1) / problem.model.focal[0] * away
        found.append(float(np.median(off)))
    return np.array(found)
