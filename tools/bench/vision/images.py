"""Images of flat printed surfaces and boxes with exact ground truth: every pixel is the mean of many samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array, apply, rigid
from gemelo.libraries.vision.tags import DEFAULT_FAMILY, tag_modules
from gemelo.schemas.cell import TagFamily

Image = NDArray[np.uint8]

SAMPLES = 8  # per axis of a pixel
PAPER, INK, TABLE = 225.0, 30.0, 150.0  # grey levels
MARGIN = 1.5  # modules of white paper around a tag


@dataclass(frozen=True)
class Surface:
    """A printed rectangle around its origin in the plane z = 0; rows of `texture` from its upper edge (+y)."""

    camera_from_surface: Array  # (4, 4)
    size: tuple[float, float]  # [m] along x and y
    texture: Array  # (rows, columns) or (rows, columns, 3) brightness


@dataclass(frozen=True)
class Conditions:
    """How an image is taken."""

    noise: float = 3.0  # grey levels, standard deviation
    blur: float = 0.6  # [px] standard deviation
    motion: float = 0.0  # [px] the way along x while the shutter is open
    gain: float = 1.0
    glare: tuple[float, float, float, float] | None = None  # x, y, radius [px] and brightness of a bright spot
    background: Array = field(default_factory=lambda: np.array([TABLE]))


def tag_surface(
    camera_from_tag: Array, size: float, number: int = 0, family: TagFamily = DEFAULT_FAMILY, margin: float = MARGIN
) -> Surface:
    """A tag whose black square has edges of `size` [m], on a white margin of `margin` modules."""
    modules = tag_modules(number, family)
    count, fine = len(modules), 4
    border = round(margin * fine)
    texture = np.where(np.kron(modules, np.ones((fine, fine), bool)), PAPER, INK)
    texture = np.pad(texture, border, constant_values=PAPER)
    edge = size * texture.shape[0] / (count * fine)
    return Surface(camera_from_tag, (edge, edge), texture)


def render(
    model: CameraModel, surfaces: Sequence[Surface], random: np.random.Generator, conditions: Conditions | None = None
) -> Image:
    """The image (h, w) or (h, w, 3) of the surfaces; a later one covers an earlier one."""
    taken = conditions or Conditions()
    colours = len(taken.background)
    image = np.empty((model.height, model.width, colours))
    image[:] = taken.background
    if surfaces:
        _paint(image, model, surfaces)
    if taken.motion:
        image = _smeared(image, taken.motion)
    if taken.blur:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), taken.blur), dtype=np.float64).reshape(image.shape)
    image *= taken.gain
    if taken.glare:
        x, y, radius, bright = taken.glare
        rows, columns = np.mgrid[: model.height, : model.width]
        image += (bright * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2.0 * radius**2)))[..., None]
    image += random.normal(0.0, taken.noise, image.shape) if taken.noise else 0.0
    seen = np.clip(np.rint(image), 0, 255).astype(np.uint8)
    return seen[..., 0] if colours == 1 else seen


def _smeared(image: Array, motion: float) -> Array:
    """The mean over a way of `motion` [px] along x."""
    width = 2 * int(np.ceil(motion / 2.0)) + 1
    kernel = np.zeros(width)
    for share in np.linspace(-0.5, 0.5, 64):
        place = share * motion + width // 2
        left = min(int(place), width - 2)
        kernel[left] += left + 1 - place
        kernel[left + 1] += place - left
    return np.asarray(cv2.filter2D(image, -1, (kernel / 64.0)[None]), dtype=np.float64).reshape(image.shape)


def _paint(image: Array, model: CameraModel, surfaces: Sequence[Surface]) -> None:
    """Draws the surfaces where they can be seen, SAMPLES x SAMPLES to a pixel."""
    outline = np.vstack([model.project(apply(s.camera_from_surface, _rectangle(s.size))) for s in surfaces])
    left, top = np.maximum(np.floor(outline.min(axis=0)).astype(int) - 2, 0)
    right, bottom = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 3, (model.width, model.height))
    if right <= left or bottom <= top:
        return
    fine = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
    x = (np.arange(left, right)[:, None] + fine).ravel()
    y = (np.arange(top, bottom)[:, None] + fine).ravel()
    rays = model.rays(np.stack(np.meshgrid(x, y), axis=-1))
    seen = np.repeat(np.repeat(image[top:bottom, left:right], SAMPLES, axis=0), SAMPLES, axis=1)
    for surface in surfaces:
        _cover(seen, rays, surface)
    rows, columns = bottom - top, right - left
    image[top:bottom, left:right] = seen.reshape(rows, SAMPLES, columns, SAMPLES, -1).mean(axis=(1, 3))


def _rectangle(size: tuple[float, float]) -> Array:
    x, y = size[0] / 2.0, size[1] / 2.0
    return np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])


def _cover(seen: Array, rays: Array, surface: Surface) -> None:
    """Writes the surface's brightness into the samples (h, w, c) whose rays (h, w, 2) meet it."""
    pose = surface.camera_from_surface
    normal, origin = pose[:3, 2], pose[:3, 3]
    depth = (normal @ origin) / (rays @ normal[:2] + normal[2])
    across = np.dstack((rays * depth[..., None], depth)) - origin
    u = across @ pose[:3, 0] / surface.size[0] + 0.5
    v = 0.5 - across @ pose[:3, 1] / surface.size[1]
    inside = (u >= 0.0) & (u < 1.0) & (v >= 0.0) & (v < 1.0) & (depth > 0.0)
    rows, columns = surface.texture.shape[:2]
    texture = surface.texture.reshape(rows, columns, -1)
    seen[inside] = texture[(v[inside] * rows).astype(int), (u[inside] * columns).astype(int)]


FACES = (  # rotation vector from the box's axes to the face's, and which of its edges are x, y and the way out
    ((0.0, 0.0, 0.0), (0, 1, 2)),
    ((np.pi, 0.0, 0.0), (0, 1, 2)),
    ((0.0, np.pi / 2, 0.0), (2, 1, 0)),
    ((0.0, -np.pi / 2, 0.0), (2, 1, 0)),
    ((-np.pi / 2, 0.0, 0.0), (0, 2, 1)),
    ((np.pi / 2, 0.0, 0.0), (0, 2, 1)),
)
SHADES = (1.0, 1.0, 0.75, 0.6, 0.85, 0.7)


def box_surfaces(camera_from_box: Array, size: Sequence[float], colour: Array) -> list[Surface]:
    """The faces of a box around its origin, edges `size` (3,) [m], that are turned towards the camera."""
    faces = []
    for (vector, (x, y, out)), shade in zip(FACES, SHADES, strict=True):
        turned = rigid(np.array(vector), np.zeros(3))
        turned[:3, 3] = turned[:3, 2] * size[out] / 2.0
        pose = camera_from_box @ turned
        if pose[:3, 2] @ pose[:3, 3] < 0.0:
            faces.append(Surface(pose, (size[x], size[y]), np.full((1, 1, 3), colour) * shade))
    return faces


def looking_down(distance: float, elevation: float = np.pi / 2, azimuth: float = 0.0) -> Array:
    """camera_from_table (4, 4) of a camera `distance` [m] from the table's origin, `elevation` [rad] above it."""
    backward = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    down = np.cross(-backward, right)
    rotation = np.stack((right, down, -backward))
    return rigid(rotation, -rotation @ (backward * distance))
