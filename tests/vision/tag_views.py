"""Views of one tag on the table, from above at a slant, as a webcam has it at half a metre."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gemelo.libraries.vision.camera_model import CameraModel, of_field_of_view
from gemelo.libraries.vision.rigid import Array, apply
from gemelo.libraries.vision.tag_pose import flat, square
from gemelo.tools.bench.vision.images import Conditions, Image, looking_down, render, tag_surface

MODEL = of_field_of_view(np.radians(60.0), 640, 480)
BARREL = CameraModel(MODEL.matrix, np.array([-0.28, 0.09, 0.001, -0.0008, 0.0]), 640, 480)
SIZE = 0.03  # [m]


@dataclass(frozen=True)
class View:
    """An image of a tag and the truth about it."""

    image: Image
    camera_from_table: Array  # (4, 4)
    camera_from_tag: Array  # (4, 4)
    corners: Array  # (4, 2) [px]

    @property
    def normal(self) -> Array:
        return self.camera_from_table[:3, 2]


def views(
    count: int, conditions: Conditions | None = None, model: CameraModel = MODEL, distance: float = 0.5, seed: int = 1
) -> Iterator[View]:
    """`count` views from all sides, 45 to 85 degrees above the table."""
    random = np.random.default_rng(seed)
    for number in range(count):
        elevation, azimuth = np.radians(random.uniform(45.0, 85.0)), random.uniform(0.0, 2.0 * np.pi)
        camera_from_table = looking_down(distance, elevation, azimuth)
        place = flat(np.array([random.uniform(-0.1, 0.1), random.uniform(-0.08, 0.08), random.uniform(0.0, 6.28)]))
        pose = camera_from_table @ place
        image = render(model, [tag_surface(pose, SIZE, number % 30)], random, conditions)
        yield View(image, camera_from_table, pose, model.project(apply(pose, square(SIZE))))


def outward(view: View, corners: Array) -> float:
    """[px] by how much the corners (4, 2) stand outside the true ones, on average."""
    away = view.corners - view.corners.mean(axis=0)
    return float(np.mean(np.sum((corners - view.corners) * away, axis=1) / np.linalg.norm(away, axis=1)))


def off_by(pose: Array, truth: Array) -> float:
    """[mm] between two poses."""
    return 1000.0 * float(np.linalg.norm(pose[:3, 3] - truth[:3, 3]))
