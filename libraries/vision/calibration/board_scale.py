"""The true size of a board against its stated one, from views of an arm whose motions are known in metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gemelo.libraries.vision.calibration.reprojection import (
    ARM_SIGMA,
    CalibrationState,
    Reprojection,
    point_slopes,
    prior_slopes,
    residuals,
    solve,
    view_slopes,
)
from gemelo.libraries.vision.rigid import Array

ROUNDS = 3
LEAST_OFF = 0.01  # a share that a board may be larger or smaller than said
SURE = 4.0  # standard deviations


def wrong_scale(problem: Reprojection, state: CalibrationState) -> str:
    """A sentence where the board is surely larger or smaller than is said; empty where it is not."""
    scale, sigma = fitted_scale(problem, state)
    if abs(scale - 1.0) < max(LEAST_OFF, SURE * sigma):
        return ""
    size = "larger" if scale > 1.0 else "smaller"
    return (
        f"the tags are {100.0 * abs(scale - 1.0):.1f} % {size} than is said of them (+-{100.0 * sigma:.1f}), or the "
        "lens's focal length is wrong by as much: measure the print's bar and give it with --bar (of a tag of "
        "cell.toml: its edge, as size), then `gemelo camera calibrate`"
    )


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
