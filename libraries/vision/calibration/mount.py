"""The pose of a camera from images of a board in several poses of the arm, by least squares on the reprojection.

Hand-eye methods in closed form (`cv2.calibrateHandEye`) only give a start: they do not know the pixels, and none of
them works for an arm that cannot tilt its tool.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from gemelo.libraries.vision.calibration.determined import determined
from gemelo.libraries.vision.calibration.reprojection import (
    ARM_SIGMA,
    BoardView,
    CalibrationState,
    Carrier,
    Reprojection,
    cost_of,
    errors_of,
    exact_arm,
    point_slopes,
    prior_slopes,
    problem_of,
    residuals,
    solve,
    view_slopes,
)
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array, from_opencv, inverse, rigid
from gemelo.schemas.reasons import Reason, because

FEWEST_POSES = 5
SUSPECT_AT, OUTLIER_AT = 2.5, 4.0  # times the median error: a view to try without, one that does not agree
LEAST_OUTLIER = 0.0012  # [m]
FOLDS = 4
CLOSED_FORMS = (cv2.CALIB_HAND_EYE_PARK, cv2.CALIB_HAND_EYE_TSAI, cv2.CALIB_HAND_EYE_DANIILIDIS)
ROUNDS = 3
LEAST_OFF = 0.01  # a share that a board may be larger or smaller than said
SURE = 4.0  # standard deviations


@dataclass(frozen=True)
class MountFit:
    """Where the camera stands, and why that may be believed or not."""

    parent_from_camera: Array  # (4, 4)
    carrier_from_board: Array  # (4, 4) of the board in the base, or on the link
    held_out: float  # [m] median error at the board of views that took no part
    errors: tuple[float, ...]  # [m] at the board, of each view
    outliers: tuple[int, ...]  # views that do not agree with the others, counted from 0
    sigma: float  # [m] standard deviation of the least determined direction
    undetermined: tuple[Reason, ...]  # what these views cannot tell
    wrong_scale: Reason | None = None  # where the board is surely larger or smaller than was said

    @property
    def faults(self) -> tuple[Reason, ...]:
        """Why it may not be used."""
        return self.undetermined if self.wrong_scale is None else (*self.undetermined, self.wrong_scale)

    @property
    def is_accepted(self) -> bool:
        """True if it may be used."""
        return not self.faults


def fit_mount(
    views: Sequence[BoardView], model: CameraModel, carrier: Carrier, height: float | None = None
) -> MountFit:
    """The camera's place from `views`; NotMeasured where they are too few to try.

    `height` [m] is the board's along z of what carries it, which an arm that cannot tilt needs.
    """
    if len(views) < FEWEST_POSES:
        raise NotMeasured(because("measure.poses.few", count=len(views), least=FEWEST_POSES))
    problem = problem_of(views, model, carrier, height)
    state, chosen, errors = _agreeing(problem, _best(problem))
    outliers = tuple(index for index in range(len(views)) if index not in chosen)
    used = problem.part(chosen)
    sigma, undetermined = determined(used, state)
    return MountFit(
        state.camera, state.board, np.inf if undetermined else _held_out(used, state),
        tuple(float(error) for error in errors), outliers, sigma, undetermined,
        None if undetermined else wrong_scale(used, state),
    )  # fmt: skip


def _best(problem: Reprojection) -> CalibrationState:
    """The solution of least cost from the starts that come to anything."""
    states = [solve(problem, start, 25) for start in _starts(problem)]
    return solve(problem, min(states, key=lambda state: cost_of(problem, state)))


def _starts(problem: Reprojection) -> list[CalibrationState]:
    """Starts for X and Y: closed forms, those that are rigid transforms, and the registration of the board's places."""
    boards = [_board_in_camera(problem, index) for index in range(len(problem.views))]
    motions = [problem.motion(index) for index in range(len(problem.views))]
    found = [_registered(boards, motions, problem.height or 0.0)]
    for method in CLOSED_FORMS:
        camera = closed_form(boards, motions, method)
        if camera is not None:
            found.append((camera, inverse(motions[0]) @ camera @ boards[0]))
    return [exact_arm(camera, board, len(boards)) for camera, board in found]


def _board_in_camera(problem: Reprojection, index: int) -> Array:
    """camera_from_board of one view alone."""
    points, ideal = problem.views[index].sighting.points, problem.ideal[index]
    solved = cv2.solvePnPGeneric(points, ideal, problem.model.matrix, None, flags=cv2.SOLVEPNP_IPPE)
    return from_opencv(solved[1][0], solved[2][0])


def closed_form(boards: Sequence[Array], motions: Sequence[Array], method: int) -> Array | None:
    """X (4, 4) by one of OpenCV's hand-eye methods from camera_from_board and G of each view, `boards` and `motions`
    (4, 4); None where what it gives is no rigid transform."""
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


def _agreeing(problem: Reprojection, state: CalibrationState) -> tuple[CalibrationState, list[int], Array]:
    """The solution of the views that agree, which they are, and the errors [m] of all views by it: the worst view is
    left out as long as the others put the board far from where it sees it."""
    count = len(problem.views)
    chosen, errors = list(range(count)), errors_of(problem, state.camera, state.board)
    for _ in range(count // 5):
        worst = max(chosen, key=lambda index: float(errors[index]))
        rest = [index for index in chosen if index != worst]
        if errors[worst] < SUSPECT_AT * float(np.median(errors[chosen])) or len(rest) < FEWEST_POSES:
            break
        other = solve(problem.part(rest), state.part([chosen.index(index) for index in rest]), 20)
        found = errors_of(problem, other.camera, other.board)
        if found[worst] <= max(LEAST_OUTLIER, OUTLIER_AT * float(np.median(found[rest]))):
            break
        state, chosen, errors = other, rest, found
    return state, chosen, errors


def _held_out(problem: Reprojection, state: CalibrationState) -> float:
    """[m] median over the views of the error at the board with what the other views give."""
    found: list[float] = []
    count = len(problem.views)
    for fold in range(min(FOLDS, count)):
        rest = [index for index in range(count) if index % FOLDS != fold]
        out = [index for index in range(count) if index % FOLDS == fold]
        other = solve(problem.part(rest), state.part(rest), 20)
        found += list(errors_of(problem.part(out), other.camera, other.board))
    return float(np.median(found))


def wrong_scale(problem: Reprojection, state: CalibrationState) -> Reason | None:
    """Where the board is surely larger or smaller than is said; None where it is not."""
    scale, sigma = fitted_scale(problem, state)
    if abs(scale - 1.0) < max(LEAST_OFF, SURE * sigma):
        return None
    code = "measure.scale.larger" if scale > 1.0 else "measure.scale.smaller"
    return because(code, percent=100.0 * abs(scale - 1.0), sigma=100.0 * sigma)


def fitted_scale(problem: Reprojection, state: CalibrationState) -> tuple[float, float]:
    """The board's size as a share of what its points say, and the standard deviation of that; by Gauss and Newton, all
    else left free."""
    scale, sigma = 1.0, np.inf
    for _ in range(ROUNDS):
        slope = _left_by_scale(problem, state)
        strength = float(slope @ slope)
        change = -float(slope @ residuals(problem, state)) / strength
        scale, sigma = scale * float(np.exp(change)), 1.0 / float(np.sqrt(strength))
        views = tuple(
            replace(view, sighting=replace(view.sighting, points=view.sighting.points * np.exp(change)))
            for view in problem.views
        )
        problem = replace(problem, views=views)
        state = solve(problem, state, 20)
    return scale, sigma


def _left_by_scale(problem: Reprojection, state: CalibrationState) -> Array:
    """Of the residuals by the scale's logarithm, without what a change of the other unknowns explains: the normal
    equations of camera and board, with the arm's error of each view eliminated."""
    count = len(problem.views)
    parts, total, mixed = [], prior_slopes(problem).T @ prior_slopes(problem), np.zeros(12)
    for index in range(count):
        known, arm = view_slopes(problem, state, index)
        by_point, through = point_slopes(problem, state, index)
        turned = through @ state.arm[index][:3, :3] @ state.board[:3, :3]
        by_scale = np.einsum("nij,nj->ni", by_point, problem.views[index].sighting.points @ turned.T).ravel()
        own = np.linalg.inv(arm.T @ arm + np.diag(ARM_SIGMA**-2.0))
        to_arm = own @ np.column_stack((arm.T @ known, arm.T @ by_scale))
        total = total + known.T @ known - known.T @ arm @ to_arm[:, :12]
        mixed = mixed + known.T @ by_scale - known.T @ arm @ to_arm[:, 12]
        parts.append((known, arm, by_scale, to_arm))
    by_known = -np.linalg.solve(total, mixed)
    rows, errors = [], []
    for known, arm, by_scale, to_arm in parts:
        by_error = -to_arm @ np.append(by_known, 1.0)
        rows.append(by_scale + known @ by_known + arm @ by_error)
        errors.append(by_error / ARM_SIGMA)
    return np.concatenate((*rows, *errors, prior_slopes(problem) @ by_known))
