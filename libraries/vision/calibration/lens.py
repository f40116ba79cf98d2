"""The lens of a camera from shots of a board; accepted by how well it is determined, never by how well it fits.

Shots without tilt fit as well as others, to a tenth of a pixel, and are wrong by centimetres: they cannot tell a longer
lens from a longer distance. The standard deviation of the focal length says so, the reprojection error does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from gemelo.libraries.vision.boards import Sighting
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array, from_opencv
from gemelo.schemas.reasons import Reason, because

FEWEST_SHOTS = 8
LARGEST_FOCAL_SIGMA = 0.004  # of the focal length
LARGEST_HELD_OUT = 0.5  # [px]
WANTED_TILT = np.radians(20.0)  # to either side, about both axes
WANTED_COVERAGE = 0.6  # of the cells of the image
CELLS = 4  # to each side of the image
OUTLIER_AT = 4.0  # times the median error of the other shots
LEAST_OUTLIER = 0.6  # [px]
SIDES = ("left", "right", "upper", "lower")  # edges of the board that are tilted away: `word.edge`


@dataclass(frozen=True)
class LensFit:
    """A lens with what says whether to believe it."""

    model: CameraModel
    focal_sigma: float  # [px]
    rms: float  # [px] of the shots that it is fitted to: says nothing about whether it is right
    held_out: float  # [px] median error of shots that took no part
    errors: tuple[float, ...]  # [px] RMS of each shot
    outliers: tuple[int, ...]  # shots that do not agree with the others, counted from 0
    advice: tuple[Reason, ...]  # what shots are missing
    faults: tuple[Reason, ...]  # why it is not accepted

    @property
    def is_accepted(self) -> bool:
        """True if it may be used."""
        return not self.faults


def fit_lens(shots: Sequence[Sighting], width: int, height: int) -> LensFit:
    """The lens of images of `width` x `height` [px]; NotMeasured for fewer shots than are needed to try."""
    if len(shots) < FEWEST_SHOTS:
        raise NotMeasured(because("measure.shots.few", count=len(shots), least=FEWEST_SHOTS))
    kept = list(range(len(shots)))
    matrix, distortion, sigma, rms, errors, poses = _solve(shots, width, height)
    outliers = _outliers(errors)
    if outliers and len(shots) - len(outliers) >= FEWEST_SHOTS:
        kept = [index for index in kept if index not in outliers]
        matrix, distortion, sigma, rms, _, poses = _solve([shots[index] for index in kept], width, height)
    used = [shots[index] for index in kept]
    model = CameraModel(matrix, distortion, width, height)
    held_out = held_out_error(used, width, height)
    advice = (*tilt_advice(poses), *coverage_advice(used, width, height))
    return LensFit(
        model, sigma, rms, held_out, tuple(errors), outliers, advice, _faults(matrix, sigma, held_out, advice)
    )


def _solve(
    shots: Sequence[Sighting], width: int, height: int
) -> tuple[Array, Array, float, float, list[float], list[Array]]:
    """K, distortion, the focal length's standard deviation [px], RMS [px], that of each shot, and camera_from_board."""
    points = [shot.points.astype(np.float32) for shot in shots]
    pixels = [shot.pixels.astype(np.float32).reshape(-1, 1, 2) for shot in shots]
    guess = cv2.initCameraMatrix2D(points, pixels, (width, height))
    rms, matrix, distortion, turns, places, deviations, _, errors = cv2.calibrateCameraExtended(
        points, pixels, (width, height), guess, np.zeros(5)
    )
    poses = [from_opencv(turned, place) for turned, place in zip(turns, places, strict=True)]
    sigma = float(np.max(np.ravel(deviations)[:2]))
    return (
        np.asarray(matrix, dtype=np.float64), np.asarray(distortion, dtype=np.float64).ravel()[:5],
        sigma, float(rms), [float(value) for value in np.ravel(errors)], poses,
    )  # fmt: skip


def _outliers(errors: Sequence[float]) -> tuple[int, ...]:
    """The shots whose error is far above the others'."""
    limit = max(LEAST_OUTLIER, OUTLIER_AT * float(np.median(errors)))
    return tuple(index for index, error in enumerate(errors) if error > limit)


def held_out_error(shots: Sequence[Sighting], width: int, height: int, folds: int = 3) -> float:
    """[px] median over the shots of the RMS error with the lens of the others; a shot's pose is taken from one half of
    its points, and its error from the other half."""
    found = []
    for fold in range(folds):
        matrix, distortion = _solve([shot for i, shot in enumerate(shots) if i % folds != fold], width, height)[:2]
        model = CameraModel(matrix, distortion, width, height)
        for shot in shots[fold::folds]:
            known = np.arange(len(shot.points)) % 2 == 0
            _, turned, place = cv2.solvePnP(shot.points[known], shot.pixels[known], matrix, distortion)
            seen = shot.points[~known] @ from_opencv(turned, place)[:3, :3].T + np.asarray(place).ravel()
            off = model.project(seen) - shot.pixels[~known]
            found.append(float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))
    return float(np.median(found))


def tilts(camera_from_board: Sequence[Array]) -> Array:
    """(n, 2) [rad] by how much each board is tilted: with its left edge away, and with its upper edge away."""
    normals = np.array([pose[:3, 2] * -np.sign(pose[2, 2]) for pose in camera_from_board])
    return np.asarray(np.arctan2(-normals[:, :2], -normals[:, 2:]))


def tilt_advice(camera_from_board: Sequence[Array]) -> tuple[Reason, ...]:
    """Which tilts no shot has, each camera_from_board (4, 4)."""
    found = tilts(camera_from_board)
    reached = (found[:, 0].max(), -found[:, 0].min(), found[:, 1].max(), -found[:, 1].min())
    return tuple(
        because("measure.advice.tilt", side=side, so_far=float(np.degrees(most)), wanted=float(np.degrees(WANTED_TILT)))
        for side, most in zip(SIDES, reached, strict=True)
        if most < WANTED_TILT
    )


def coverage(shots: Sequence[Sighting], width: int, height: int) -> Array:
    """(CELLS, CELLS) True where a shot has a point."""
    seen = np.zeros((CELLS, CELLS), dtype=bool)
    for shot in shots:
        columns = np.clip(shot.pixels[:, 0] / width * CELLS, 0, CELLS - 1).astype(int)
        rows = np.clip(shot.pixels[:, 1] / height * CELLS, 0, CELLS - 1).astype(int)
        seen[rows, columns] = True
    return seen


def coverage_advice(shots: Sequence[Sighting], width: int, height: int) -> tuple[Reason, ...]:
    """Where in the image no shot has a point, if that is much of it."""
    seen = coverage(shots, width, height)
    if seen.mean() >= WANTED_COVERAGE:
        return ()
    down, across = ("upper", "lower"), ("left", "right")
    half = CELLS // 2
    quarters = {
        f"{down[r]} {across[c]}": seen[r * half : (r + 1) * half, c * half : (c + 1) * half].mean()
        for r in (0, 1)
        for c in (0, 1)
    }
    emptiest = min(quarters, key=lambda name: float(quarters[name]))
    return (because("measure.advice.cover", quarter=emptiest, covered=float(seen.mean())),)


def _faults(matrix: Array, sigma: float, held_out: float, advice: Sequence[Reason]) -> tuple[Reason, ...]:
    focal = float(matrix[0, 0])
    faults = []
    if not sigma <= LARGEST_FOCAL_SIGMA * focal:
        mend = advice[0] if advice else because("measure.advice.nearer")
        most = LARGEST_FOCAL_SIGMA * focal
        faults.append(because("measure.lens.focal", mend, sigma=sigma, focal=focal, most=most))
    if not held_out <= LARGEST_HELD_OUT:
        faults.append(because("measure.lens.held_out", off=held_out, most=LARGEST_HELD_OUT))
    return tuple(faults)
