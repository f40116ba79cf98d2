"""Determinacy of a camera's place by views of a board: the rank of their Jacobian, and what is undetermined by name."""

from __future__ import annotations

import numpy as np

from gemelo.libraries.vision.calibration.reprojection import (
    ARM_SIGMA,
    KNOWN,
    CalibrationState,
    Carrier,
    Reprojection,
    prior_slopes,
    view_slopes,
)
from gemelo.libraries.vision.rigid import Array
from gemelo.schemas.reasons import Reason, because

LENGTH = 0.2  # [m] at which a turn counts as much as a step
SCALE = np.tile([1.0 / LENGTH] * 3 + [1.0] * 3, 2)
LARGEST_SIGMA = 0.01  # [m] of a direction that counts as determined
LEAST_SHARE = 0.25  # of a direction that cannot be determined, for a name to be part of it


def information(problem: Reprojection, state: CalibrationState, index: int) -> Array:
    """(12, 12) [1/m^2] what one view tells of camera and board, turns at `LENGTH`, whatever the arm's error in it is
    (the Schur complement of that error)."""
    known, arm = view_slopes(problem, state, index)
    known = known * SCALE
    between = known.T @ arm
    own = arm.T @ arm + np.diag(ARM_SIGMA**-2.0)
    return np.asarray(known.T @ known - between @ np.linalg.solve(own, between.T))


def prior_information(problem: Reprojection) -> Array:
    """(12, 12) [1/m^2] the same of what is known without any image."""
    slopes = prior_slopes(problem) * SCALE
    return np.asarray(slopes.T @ slopes)


def determined(problem: Reprojection, state: CalibrationState) -> tuple[float, tuple[Reason, ...]]:
    """[m] of the least determined direction of camera and board, and for each that is not determined what it is."""
    views = [information(problem, state, index) for index in range(len(problem.views))]
    strengths, directions = np.linalg.eigh(np.sum(views, axis=0) + prior_information(problem))
    sigmas = 1.0 / np.sqrt(np.maximum(strengths, 1e-18))
    loose = [direction for sigma, direction in zip(sigmas, directions.T, strict=True) if sigma > LARGEST_SIGMA]
    return float(sigmas.max()), tuple(_undetermined(problem.carrier, direction) for direction in loose)


def _undetermined(carrier: Carrier, direction: Array) -> Reason:
    """What a direction of the unknowns that nothing determines is, by `word.place`, and what to do."""
    board = "board on link" if carrier is Carrier.BOARD else "board in base"
    unknowns = ("turn about x", "turn about y", "turn about z", "x", "y", "height")
    names = [f"{whose} {name}" for whose in ("camera", board) for name in unknowns]
    assert len(names) == KNOWN
    strongest = np.abs(direction).max()
    part = [name for name, share in zip(names, direction, strict=True) if abs(share) > LEAST_SHARE * strongest]
    is_height = {"camera height", f"{board} height"} == set(part)
    mend = because("measure.advice.height" if is_height else "measure.advice.poses")
    if len(part) > 1:
        return because("measure.undetermined.several", mend, parts=tuple(part[:-1]), last=part[-1])
    return because("measure.undetermined", mend, part=part[0])
