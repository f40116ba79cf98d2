"""Windows: whatever lies in an image is in one of them, whole, and what it shows is where the image has it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.windows import MARGIN, Window, halved, regions_of, windows_around
from tests.profiles import examples
from tests.vision.tag_views import BARREL


@examples(quick=15, full=60)
@given(st.integers(60, 131), st.integers(60, 131), st.data())
def test_a_region_is_whole_in_its_window_with_paper_around_it(width: int, height: int, data: st.DataObject) -> None:
    left, top = data.draw(st.integers(0, width - 12)), data.draw(st.integers(0, height - 12))
    right, bottom = data.draw(st.integers(left + 8, width)), data.draw(st.integers(top + 8, height))
    image = np.zeros((height, width, 3), np.uint8)
    image[top:bottom, left:right] = 200
    mask = halved(image)[..., 0] > 70
    ((window, core),) = windows_around(mask, (height, width), 4, mask.size)
    part = window.of(image)[..., 0] > 70
    assert part.shape == core.shape == (window.height, window.width)
    assert part.sum() == (bottom - top) * (right - left)
    (region,) = regions_of(part, 60)
    assert region[core].any()
    for near, far in ((window.left, left), (window.top, top)):
        assert near <= max(0, far - 2 * MARGIN + 3)
    assert window.left + window.width >= min(width, right + 2 * MARGIN - 3)
    assert window.top + window.height >= min(height, bottom + 2 * MARGIN - 3)


def test_what_is_too_small_or_too_large_has_no_window() -> None:
    mask = np.zeros((60, 80), bool)
    mask[5:7, 5:7] = mask[20:50, 20:60] = True
    assert len(list(windows_around(mask, (120, 160), 1, mask.size))) == 2
    assert len(list(windows_around(mask, (120, 160), 5, mask.size))) == 1
    assert list(windows_around(mask, (120, 160), 5, 1000)) == []


def test_a_lens_within_a_window_sees_the_same_rays() -> None:
    window = Window(100, 60, 200, 150)
    pixels = np.random.default_rng(1).uniform((100.0, 60.0), (300.0, 210.0), (50, 2))
    seen = BARREL.within(window).rays(pixels - (100.0, 60.0))
    assert np.abs(seen - BARREL.rays(pixels)).max() < 1e-9


def test_rays_are_the_inverse_of_pixels_up_to_the_corners() -> None:
    strong = CameraModel(BARREL.matrix, np.array([-0.3, 0.12, 0.002, -0.0015, -0.02]), 640, 480)
    grid = np.stack(np.meshgrid(np.linspace(0.0, 639.0, 33), np.linspace(0.0, 479.0, 25)), axis=-1).reshape(-1, 2)
    for model in (BARREL, strong):
        assert np.abs(model.pixels(model.rays(grid)) - grid).max() < 1e-6
