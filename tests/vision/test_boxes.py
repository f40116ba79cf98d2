"""Boxes on the table: the silhouette fit against the truth, beside the middle of the region."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gemelo.libraries.vision.boxes import colour_strength, coloured_regions, fit_box, region_centre
from gemelo.libraries.vision.rigid import Array, rigid
from gemelo.libraries.vision.tag_pose import flat
from gemelo.tools.bench.vision.images import Conditions, Image, Surface, box_surfaces, looking_down, render
from tests.vision.tag_views import MODEL

RED = np.array([200.0, 40.0, 35.0])
GREY = Conditions(background=np.array([150.0, 150.0, 150.0]))


def standing(values: Array, height: float) -> Array:
    """plane_from_box (4, 4)."""
    return flat(values) @ rigid(np.zeros(3), np.array([0.0, 0.0, height / 2.0]))


def picture(camera: Array, values: Array, size: tuple[float, ...]) -> Image:
    """A red box on a grey table."""
    faces = box_surfaces(camera @ standing(values, size[2]), size, RED)
    return render(MODEL, faces, np.random.default_rng(1), GREY)


def draws(count: int) -> list[tuple[Array, Array]]:
    random = np.random.default_rng(6)
    found = []
    for _ in range(count):
        camera = looking_down(0.5, np.radians(random.choice([55.0, 85.0])), random.uniform(0.0, 6.28))
        found.append((camera, np.array([random.uniform(-0.1, 0.1), random.uniform(-0.08, 0.08), random.uniform(0, 6)])))
    return found


def test_a_cube_is_placed_within_half_a_millimetre_where_the_regions_middle_is_off_by_many() -> None:
    size = (0.03, 0.03, 0.03)
    ours, naive, shares = [], [], []
    for camera, values in draws(16):
        image = picture(camera, values, size)
        strength = colour_strength(image, RED)
        (region,) = coloured_regions(strength)
        fit = fit_box(strength, region, MODEL, camera, size)
        assert fit is not None
        ours.append(1000.0 * np.linalg.norm(fit.plane_from_box[:2, 3] - values[:2]))
        shares.append(ours[-1] / (1000.0 * fit.sigma))
        naive.append(1000.0 * np.linalg.norm(region_centre(region, MODEL, camera, 0.0)[:2] - values[:2]))
    assert np.percentile(naive, 95) > 5.0
    assert np.percentile(ours, 95) < 0.5
    assert np.sqrt(np.mean(np.square(shares))) < 2.0


def test_a_long_box_is_turned_as_it_lies() -> None:
    size = (0.06, 0.025, 0.02)
    for camera, values in draws(8):
        image = picture(camera, values, size)
        strength = colour_strength(image, RED)
        fit = fit_box(strength, coloured_regions(strength)[0], MODEL, camera, size)
        assert fit is not None
        turned = np.arctan2(fit.plane_from_box[1, 0], fit.plane_from_box[0, 0]) - values[2]
        assert abs((turned + np.pi / 2) % np.pi - np.pi / 2) < np.radians(0.6)


def test_a_finger_over_an_edge_does_not_move_the_box() -> None:
    size = (0.03, 0.03, 0.03)
    camera, values = looking_down(0.5, np.radians(85.0)), np.array([0.0, 0.0, 0.3])
    faces = box_surfaces(camera @ standing(values, size[2]), size, RED)
    above = camera @ flat(values) @ rigid(np.zeros(3), np.array([0.018, 0.0, 0.031]))
    finger = Surface(above, (0.014, 0.01), np.full((1, 1, 3), [190.0, 180.0, 175.0]))
    image = render(MODEL, [*faces, finger], np.random.default_rng(1), GREY)
    strength = colour_strength(image, RED)
    fit = fit_box(strength, coloured_regions(strength)[0], MODEL, camera, size)
    assert fit is not None
    assert 1000.0 * np.linalg.norm(fit.plane_from_box[:2, 3]) < 0.7


def test_a_box_of_another_size_fits_badly_and_says_so() -> None:
    camera, values = looking_down(0.5, np.radians(55.0)), np.array([0.0, 0.0, 0.3])
    image = picture(camera, values, (0.03,) * 3)
    strength = colour_strength(image, RED)
    region = coloured_regions(strength)[0]
    right, wrong = (fit_box(strength, region, MODEL, camera, (edge,) * 3) for edge in (0.03, 0.034))
    assert right is not None
    assert wrong is not None
    assert wrong.error > 3.0 * right.error


def test_grey_is_no_colour() -> None:
    with pytest.raises(ValueError, match=r"nearly grey.*put a tag on the thing"):
        colour_strength(np.zeros((4, 4, 3), np.uint8), (120.0, 125.0, 118.0))
    assert cv2.countNonZero((colour_strength(np.full((4, 4, 3), 90, np.uint8), RED) > 0.01).astype(np.uint8)) == 0
