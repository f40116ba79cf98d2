"""The lens from shots of a board: accepted where it is determined, refused by name where it only fits."""

from __future__ import annotations

import numpy as np
import pytest

from gemelo.libraries.vision.boards import ChessBoard, Sighting, picture
from gemelo.libraries.vision.calibration.lens import fit_lens, tilts
from gemelo.libraries.vision.errors import NotMeasured
from gemelo.libraries.vision.rigid import Array, apply, rigid, turn
from gemelo.schemas.reasons import because
from gemelo.tools.bench.vision.images import Surface, render
from tests.vision.tag_views import BARREL

BOARD = ChessBoard()
POINTS = np.array([[0.025 * x, 0.025 * y, 0.0] for y in range(1, 6) for x in range(1, 8)])
MIDDLE = np.array([0.1, 0.075, 0.0])


def poses(count: int, tilt: float, seed: int = 0) -> list[Array]:
    """camera_from_board (4, 4) with tilts up to `tilt` [rad] about both axes."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        facing = turn(np.array([np.pi, 0.0, 0.0])) @ turn(np.append(random.uniform(-tilt, tilt, 2), 0.0))
        place = np.array([random.uniform(-0.08, 0.08), random.uniform(-0.06, 0.06), random.uniform(0.32, 0.5)])
        found.append(rigid(facing, place - facing @ MIDDLE))
    return found


def shots(count: int, tilt: float, noise: float = 0.08, seed: int = 0) -> list[Sighting]:
    random = np.random.default_rng(seed + 100)
    return [
        Sighting(POINTS, BARREL.project(apply(pose, POINTS)) + random.normal(0.0, noise, (len(POINTS), 2)))
        for pose in poses(count, tilt, seed)
    ]


def ray_error(found: Array) -> float:
    """[mm] at half a metre by a wrong focal length, 150 mm off the middle."""
    return 150.0 * abs(found[0, 0] / BARREL.matrix[0, 0] - 1.0)


def test_shots_with_tilt_give_the_lens() -> None:
    fit = fit_lens(shots(15, np.radians(35.0)), 640, 480)
    assert fit.is_accepted
    assert ray_error(fit.model.matrix) < 0.5
    assert abs(fit.model.matrix[0, 0] - BARREL.matrix[0, 0]) < 4.0 * fit.focal_sigma


def test_shots_without_tilt_fit_as_well_and_are_refused_by_the_focal_length() -> None:
    flat, tilted = (fit_lens(shots(15, np.radians(angle)), 640, 480) for angle in (4.0, 35.0))
    assert flat.rms < 1.1 * tilted.rms  # gating on it would accept both
    assert not flat.is_accepted
    assert flat.faults[0].code == "measure.lens.focal"
    assert [cause.code for cause in flat.faults[0].causes] == ["measure.advice.tilt"]
    assert flat.focal_sigma > 5.0 * tilted.focal_sigma


def test_a_shot_that_is_off_is_named_and_left_out() -> None:
    taken = shots(15, np.radians(35.0))
    taken[4] = Sighting(POINTS, taken[4].pixels + np.random.default_rng(3).normal(0.0, 2.0, taken[4].pixels.shape))
    fit = fit_lens(taken, 640, 480)
    assert fit.outliers == (4,)
    assert ray_error(fit.model.matrix) < 0.5


def test_what_is_missing_is_said() -> None:
    pile = [Sighting(shot.points, shot.pixels * 0.4 + (10.0, 10.0)) for shot in shots(12, np.radians(5.0))]
    fit = fit_lens(pile, 640, 480)
    assert [each.code for each in fit.advice].count("measure.advice.tilt") >= 2
    (corner,) = (each for each in fit.advice if each.code == "measure.advice.cover")
    assert corner.values["quarter"] != "upper left"


def test_a_tilt_has_the_sign_that_the_advice_names() -> None:
    away = turn(np.array([np.pi, 0.0, 0.0])) @ turn(np.array([np.radians(25.0), 0.0, 0.0]))
    pose = rigid(away, np.array([0.0, 0.0, 0.5]))
    upper, lower = apply(pose, np.array([[0.0, 0.1, 0.0], [0.0, -0.1, 0.0]]))
    assert (upper[2] > lower[2]) == (tilts([pose])[0, 1] > 0.0)
    sideways = turn(np.array([np.pi, 0.0, 0.0])) @ turn(np.array([0.0, np.radians(25.0), 0.0]))
    pose = rigid(sideways, np.array([0.0, 0.0, 0.5]))
    left, right = apply(pose, np.array([[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]]))
    assert (left[2] > right[2]) == (tilts([pose])[0, 0] > 0.0)


def test_too_few_shots_are_counted() -> None:
    with pytest.raises(NotMeasured) as refused:
        fit_lens(shots(3, 0.5), 640, 480)
    assert refused.value.reason == because("measure.shots.few", count=3, least=8)


def test_the_board_in_an_image_is_where_it_is() -> None:
    margin = 0.01
    texture = picture(BOARD.squares(), BOARD.size, margin, 4000.0) * 0.75 + 20.0
    size = (BOARD.size[0] + 2 * margin, BOARD.size[1] + 2 * margin)
    for pose in poses(2, np.radians(30.0)):
        centred = pose @ rigid(np.zeros(3), MIDDLE)
        image = render(BARREL, [Surface(centred, size, texture)], np.random.default_rng(0))
        seen = BOARD.find(image)
        assert seen is not None
        assert len(seen.points) > 25
        off = seen.pixels - BARREL.project(apply(pose, seen.points))
        assert np.sqrt(np.mean(off**2)) < 0.15
        assert np.abs(off.mean(axis=0)).max() < 0.05
