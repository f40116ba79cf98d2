"""Where a camera stands, from images of a board in several poses of the arm, by least squares on the reprojection.

Either the camera stands and the board moves with a link, or the camera moves with a link and the board stands. Both are
one equation: camera_from_point = inverse(X) G N Y point, where X is the camera in its parent, Y the board in what
carries it, G what the arm's joints say, and N a small error of the arm in that pose, with a prior. Hand-eye methods in
closed form (`cv2.calibrateHandEye`) only give a start: they do not know the pixels, and none of them works for an arm
that cannot tilt its tool.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum

import cv2
import numpy as np
from numpy.typing import NDArray

from services.vision.boards import Sighting
from services.vision.camera_model import CameraModel
from services.vision.rigid import Array, apply, from_opencv, inverse, rigid
from services.vision.tag_pose import moved

FEWEST_POSES = 5
ROUNDS = 60
ARM_SIGMA = np.array([0.002] * 3 + [0.0005] * 3)  # [rad], [m] prior of the arm's error in a pose
LENGTH = 0.2  # [m] at which a turn counts as much as a step
LARGEST_SIGMA = 0.01  # [m] of a direction that counts as determined
SUSPECT_AT, OUTLIER_AT = 2.5, 4.0  # times the median error: a view to try without, one that does not agree
LEAST_OUTLIER = 0.0012  # [m]
LEAST_SHARE = 0.25  # of a direction that cannot be determined, for a name to be part of it
FAR = 0.5  # [m] from what carries it a board is not much farther, which matters only to what is undetermined
KNOWN_SIGMA = 0.0002  # [m] of a height that was measured by hand
CLOSED_FORMS = (cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_TSAI, cv2.CALIB_HAND_EYE_DANIILIDIS)


class Carrier(Enum):
    """What the arm moves."""

    CAMERA = "camera"  # it rides on a link, the board stands
    BOARD = "board"  # it rides on a link, the camera stands


@dataclass(frozen=True)
class View:
    """A board in an image while the arm stands in one pose."""

    base_from_link: Array  # (4, 4) of the link that carries the board or the camera
    sighting: Sighting


@dataclass(frozen=True)
class MountFit:
    """Where the camera stands, and why that may be believed or not."""

    parent_from_camera: Array  # (4, 4)
    carrier_from_board: Array  # (4, 4) of the board in the base, or on the link
    held_out: float  # [m] median error at the board of views that took no part
    errors: tuple[float, ...]  # [m] at the board, of each view
    outliers: tuple[int, ...]  # views that do not agree with the others, counted from 0
    sigma: float  # [m] standard deviation of the least determined direction
    undetermined: tuple[str, ...]  # what these views cannot tell: a sentence each

    @property
    def is_accepted(self) -> bool:
        """True if it may be used."""
        return not self.undetermined


@dataclass(frozen=True)
class Problem:
    """All that is measured."""

    views: tuple[View, ...]
    model: CameraModel
    carrier: Carrier
    height: float | None = None  # [m] of the board along z of what carries it, where that was measured
    ideal: tuple[Array, ...] = field(default=())  # (n, 2) [px] of each view without distortion

    def motion(self, index: int) -> Array:
        """G of a view."""
        pose = self.views[index].base_from_link
        return pose if self.carrier is Carrier.BOARD else inverse(pose)


@dataclass(frozen=True)
class State:
    """What is looked for: X, Y and the arm's error in each view."""

    camera: Array  # (4, 4) X
    board: Array  # (4, 4) Y
    arm: tuple[Array, ...]  # (4, 4) N of each view


def fit_mount(views: Sequence[View], model: CameraModel, carrier: Carrier, height: float | None = None) -> MountFit:
    """The camera's place from `views`; ValueError where they are too few to try. `height` [m] is the board's along z of
    what carries it, which an arm that cannot tilt needs."""
    if len(views) < FEWEST_POSES:
        raise ValueError(f"{len(views)} poses show the board, at least {FEWEST_POSES} are needed")
    ideal = tuple(model.ideal(view.sighting.pixels) for view in views)
    problem = Problem(tuple(views), model, carrier, height, ideal)
    state, chosen, errors = _agreeing(problem, _best(problem))
    outliers = tuple(index for index in range(len(views)) if index not in chosen)
    used = _part(problem, chosen)
    sigma, undetermined = _determined(used, state)
    held_out = np.inf if undetermined else _held_out(used, state)
    return MountFit(
        state.camera, state.board, held_out, tuple(float(error) for error in errors), outliers, sigma, undetermined
    )


def _part(problem: Problem, chosen: Sequence[int]) -> Problem:
    views = tuple(problem.views[index] for index in chosen)
    ideal = tuple(problem.ideal[index] for index in chosen)
    return Problem(views, problem.model, problem.carrier, problem.height, ideal)


def _pick(state: State, chosen: Sequence[int]) -> State:
    return State(state.camera, state.board, tuple(state.arm[index] for index in chosen))


def _best(problem: Problem) -> State:
    """The solution of least cost from the starts that come to anything."""
    states = [_solve(problem, start, 25) for start in _starts(problem)]
    return _solve(problem, min(states, key=lambda state: _cost(problem, state)))


def _starts(problem: Problem) -> list[State]:
    """Starts for X and Y: closed forms, those that are rigid transforms, and the registration of the board's places."""
    boards = [_board_in_camera(problem, index) for index in range(len(problem.views))]
    motions = [problem.motion(index) for index in range(len(problem.views))]
    found = [_registered(boards, motions, problem.height or 0.0)]
    for method in CLOSED_FORMS:
        camera = _closed_form(boards, motions, method)
        if camera is not None:
            found.append((camera, inverse(motions[0]) @ camera @ boards[0]))
    nothing = (np.eye(4),) * len(boards)
    return [State(camera, board, nothing) for camera, board in found]


def _board_in_camera(problem: Problem, index: int) -> Array:
    """camera_from_board of one view alone."""
    points, ideal = problem.views[index].sighting.points, problem.ideal[index]
    solved = cv2.solvePnPGeneric(points, ideal, problem.model.matrix, None, flags=cv2.SOLVEPNP_IPPE)
    return from_opencv(solved[1][0], solved[2][0])


def _closed_form(boards: Sequence[Array], motions: Sequence[Array], method: int) -> Array | None:
    """X by one of OpenCV's hand-eye methods; None where what it gives is no rigid transform."""
    back = [inverse(motion) for motion in motions]
    try:
        turned, place = cv2.calibrateHandEye(
            [pose[:3, :3] for pose in back], [pose[:3, 3] for pose in back],
            [pose[:3, :3] for pose in boards], [pose[:3, 3] for pose in boards], method=method,
        )  # fmt: skip
    except cv2.error:
        return None
    rotation = np.asarray(turned, dtype=np.float64)
    if not np.isfinite(rotation).all() or abs(np.linalg.det(rotation) - 1.0) > 1e-3:
        return None
    return rigid(rotation, np.asarray(place, dtype=np.float64)[:, 0])


def _registered(boards: Sequence[Array], motions: Sequence[Array], height: float) -> tuple[Array, Array]:
    """X and Y by matching where the camera sees the board with where the arm carries it, its offset taken as zero
    (Kabsch 1976; Umeyama's sign)."""
    seen = np.array([pose[:3, 3] for pose in boards])
    carried = np.array([motion[:3, 3] + height * motion[:3, 2] for motion in motions])
    u, _, vt = np.linalg.svd((carried - carried.mean(axis=0)).T @ (seen - seen.mean(axis=0)))
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    camera = rigid(rotation, carried.mean(axis=0) - rotation @ seen.mean(axis=0))
    return camera, inverse(motions[0]) @ camera @ boards[0]


def _placed(problem: Problem, state: State, index: int) -> Array:
    """The board's points (n, 3) of a view in the camera's frame."""
    chain = inverse(state.camera) @ problem.motion(index) @ state.arm[index] @ state.board
    return apply(chain, problem.views[index].sighting.points)


def _residuals(problem: Problem, state: State) -> Array:
    """All that is off, each in its own standard deviations: pixels, the arm's errors, the board's place."""
    parts = []
    for index, view in enumerate(problem.views):
        placed = _placed(problem, state, index)
        seen = placed[:, :2] / placed[:, 2:] * problem.model.focal + problem.model.centre
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


def _cost(problem: Problem, state: State) -> float:
    """Half the sum of squares, large ones counted less (Huber at 3)."""
    off = np.abs(_residuals(problem, state))
    cost = float(np.sum(np.where(off < 3.0, off**2 / 2.0, 3.0 * off - 4.5)))
    in_front = all(_placed(problem, state, index)[:, 2].min() > 0.0 for index in range(len(problem.views)))
    return cost if in_front else cost + 1e12


def _jacobian(problem: Problem, state: State) -> Array:
    """Of `_residuals` by (12 + 6 views): the camera's turn and step in its parent, the board's in its carrier, the
    arm's in each view."""
    count = len(problem.views)
    rows = []
    back = inverse(state.camera)
    for index, view in enumerate(problem.views):
        placed = _placed(problem, state, index)
        z = placed[:, 2]
        by_point = np.zeros((len(placed), 2, 3))
        by_point[:, 0, 0], by_point[:, 1, 1] = 1.0 / z, 1.0 / z
        by_point[:, 0, 2], by_point[:, 1, 2] = -placed[:, 0] / z**2, -placed[:, 1] / z**2
        by_point *= problem.model.focal[:, None] / view.sighting.sigma
        on_board = apply(state.board, view.sighting.points)
        carried = apply(state.arm[index], on_board)
        in_parent = apply(problem.motion(index), carried)
        to_camera = back[:3, :3]
        through = to_camera @ problem.motion(index)[:3, :3]
        block = np.zeros((len(placed), 2, 12 + 6 * count))
        by_arm = by_point @ through
        block[:, :, :6] = -by_point @ to_camera @ _by_motion(in_parent - state.camera[:3, 3])
        block[:, :, 6:12] = by_arm @ state.arm[index][:3, :3] @ _by_motion(on_board - state.board[:3, 3])
        block[:, :, 12 + 6 * index : 18 + 6 * index] = by_arm @ _by_motion(carried - state.arm[index][:3, 3])
        rows.append(block.reshape(-1, 12 + 6 * count))
    prior = np.zeros((6 * count, 12 + 6 * count))
    prior[:, 12:] = np.diag(np.tile(1.0 / ARM_SIGMA, count))
    rows.append(prior)
    nearby = np.zeros((3, 12 + 6 * count))
    nearby[:, 9:12] = np.eye(3) / FAR
    rows.append(nearby)
    if problem.height is not None:
        known = np.zeros((1, 12 + 6 * count))
        known[0, 11] = 1.0 / KNOWN_SIGMA
        rows.append(known)
    return np.vstack(rows)


def _by_motion(points: Array) -> Array:
    """(n, 3, 6): how points (n, 3) move with a turn about the origin and a step."""
    found = np.zeros((len(points), 3, 6))
    x, y, z = points.T
    found[:, 0, 1], found[:, 1, 0] = z, -z
    found[:, 1, 2], found[:, 2, 1] = x, -x
    found[:, 2, 0], found[:, 0, 2] = y, -y
    found[:, :, 3:] = np.eye(3)
    return found


def _solve(problem: Problem, state: State, rounds: int = ROUNDS) -> State:
    """Levenberg and Marquardt with Huber's weights from `state`."""
    damping, cost = 1e-4, _cost(problem, state)
    for _ in range(rounds):
        off = _residuals(problem, state)
        weights = np.sqrt(np.minimum(1.0, 3.0 / np.maximum(np.abs(off), 1e-9)))
        slope = _jacobian(problem, state) * weights[:, None]
        normal, gradient = slope.T @ slope, slope.T @ (off * weights)
        scaled = normal + damping * np.diag(np.diag(normal)) + 1e-9 * np.eye(len(normal))
        candidate = _stepped(state, np.asarray(-np.linalg.solve(scaled, gradient), dtype=np.float64))
        now = _cost(problem, candidate)
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


def _stepped(state: State, change: Array) -> State:
    arm = tuple(moved(pose, change[12 + 6 * i : 18 + 6 * i]) for i, pose in enumerate(state.arm))
    return State(moved(state.camera, change[:6]), moved(state.board, change[6:12]), arm)


def _errors(problem: Problem, state: State) -> Array:
    """[m] at the board, of each view as the arm's joints say: the median of its points across the line of sight."""
    exact = State(state.camera, state.board, (np.eye(4),) * len(problem.views))
    found = []
    for index in range(len(problem.views)):
        placed = _placed(problem, exact, index)
        seen = placed[:, :2] / placed[:, 2:] * problem.model.focal + problem.model.centre
        off = np.linalg.norm(seen - problem.ideal[index], axis=1) / problem.model.focal[0] * placed[:, 2]
        found.append(float(np.median(off)))
    return np.array(found)


def _agreeing(problem: Problem, state: State) -> tuple[State, list[int], Array]:
    """The solution of the views that agree, which they are, and the errors [m] of all views by it: the worst view is
    left out as long as the others put the board far from where it sees it."""
    count = len(problem.views)
    chosen, errors = list(range(count)), _errors(problem, state)
    for _ in range(count // 5):
        worst = max(chosen, key=lambda index: float(errors[index]))
        rest = [index for index in chosen if index != worst]
        if errors[worst] < SUSPECT_AT * float(np.median(errors[chosen])) or len(rest) < FEWEST_POSES:
            break
        arm = {index: state.arm[place] for place, index in enumerate(chosen)}
        other = _solve(_part(problem, rest), State(state.camera, state.board, tuple(arm[index] for index in rest)), 20)
        found = _errors(problem, State(other.camera, other.board, (np.eye(4),) * count))
        if found[worst] <= max(LEAST_OUTLIER, OUTLIER_AT * float(np.median(found[rest]))):
            break
        state, chosen, errors = other, rest, found
    return state, chosen, errors


def _held_out(problem: Problem, state: State, folds: int = 4) -> float:
    """[m] median over the views of the error at the board with what the other views give."""
    found: list[float] = []
    count = len(problem.views)
    for fold in range(min(folds, count)):
        rest = [index for index in range(count) if index % folds != fold]
        out = [index for index in range(count) if index % folds == fold]
        other = _solve(_part(problem, rest), _pick(state, rest), 20)
        part = _part(problem, out)
        found += list(_errors(part, State(other.camera, other.board, (np.eye(4),) * len(out))))
    return float(np.median(found))


def _determined(problem: Problem, state: State) -> tuple[float, tuple[str, ...]]:
    """[m] of the least determined direction of X and Y, and a sentence for each that is not determined."""
    slope = _jacobian(problem, state)
    scale = np.tile([1.0 / LENGTH] * 3 + [1.0] * 3, 2)
    known, arm = slope[:, :12] * scale, slope[:, 12:]
    left = known - arm @ np.linalg.lstsq(arm, known, rcond=None)[0]  # what the arm's errors cannot explain
    strengths, directions = np.linalg.svd(left, full_matrices=False)[1:]
    sigmas = 1.0 / np.maximum(strengths, 1e-9)
    loose = [direction for sigma, direction in zip(sigmas, directions, strict=True) if sigma > LARGEST_SIGMA]
    return float(sigmas.max()), tuple(_sentence(problem.carrier, direction) for direction in loose)


def _sentence(carrier: Carrier, direction: NDArray[np.float64]) -> str:
    """What a direction of the unknowns that nothing determines is, and what to do."""
    where = "on the link" if carrier is Carrier.BOARD else "in the base"
    camera = ("turn about x", "turn about y", "turn about z", "x", "y", "height")
    board = tuple(f"{name} {where}" for name in camera)
    names = [f"the camera's {name}" for name in camera] + [f"the board's {name}" for name in board]
    strongest = np.abs(direction).max()
    part = [name for name, share in zip(names, direction, strict=True) if abs(share) > LEAST_SHARE * strongest]
    said = (
        f"{', '.join(part[:-1])} and {part[-1]} cannot be told apart"
        if len(part) > 1
        else (f"{part[0]} cannot be determined")
    )
    heights = {"the camera's height", f"the board's height {where}"}
    remedy = (
        "measure the board's height and give it with --height"
        if heights <= set(part)
        else "take poses that are tilted by 30 degrees about two axes, or touch points of a printed board"
    )
    return f"{said}: {remedy}"
