"""The image of solids in a camera: every sample's own ray, the nearest face along it, then what optics add. Pure.

The ray of each sample is taken through the inverse of the lens distortion, so a straight edge is bent exactly as
`cv2.projectPoints` bends it. On a ray (x, y, 1) the inverse depth of a plane is linear in x and y, and so is the side
of every edge: a face needs no clipping, and the nearest of them is the greatest 1 / z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import Rigid, compose, inverse
from gemelo.schemas.camera import CameraInfo
from gemelo.services.camera.virtual.lens import Array, Lens, Samples, lens_of
from gemelo.services.camera.virtual.solids import Colour, Face, PosedSolid

Image = NDArray[np.uint8]

EDGE_ON = 1e-12  # [m] from the camera to the plane of a face
NEAR = 0.005  # [m] nothing nearer than this is seen
GREYS = 256  # the first colours of the palette, for textures
LIGHT = np.array([0.3, 0.2, 0.93])  # the direction to the lamp, in the base
SHIFTS = 256  # [px] by which the field of noise is larger than an image: so many squared images differ
SPREADING = 40503  # odd: neighbouring seeds give parts that lie far apart
AMBIENT = 0.55  # of the brightness of a face that the lamp does not reach


@dataclass(frozen=True)
class Optics:
    """What a camera adds to the exact image."""

    samples: int = 2  # along each side of a pixel
    blur: float = 0.6  # [px] standard deviation
    motion: tuple[float, float] = (0.0, 0.0)  # [px] right and down, during the exposure
    brightness: float = 1.0
    glare: tuple[tuple[float, float, float], ...] = ()  # reflections: column, row and standard deviation [px]
    noise: float = 3.0  # standard deviation, of 255
    background: Colour = (70, 74, 80)


@dataclass(frozen=True, eq=False)
class _Target:
    """The samples that are drawn on: `nearness` 1 / z [1/m] and `index` into the palette, both (h s, w s)."""

    lens: Lens
    nearness: Samples
    index: NDArray[np.uint16]
    palette: list[Colour]


def render(
    solids: Sequence[PosedSolid], camera: CameraInfo, base_from_camera: Rigid, optics: Optics = Optics(), seed: int = 0
) -> Image:
    """The image (height, width, 3) in red, green, blue; the same `seed` gives the same noise."""
    lens = lens_of(camera, optics.samples)
    grey: list[Colour] = [(level, level, level) for level in range(GREYS)]
    target = _Target(
        lens,
        np.zeros(lens.x.shape, np.float32),
        np.full(lens.x.shape, GREYS, np.uint16),
        [*grey, optics.background],
    )
    camera_from_base = inverse(base_from_camera)
    for solid in solids:
        _draw(target, solid, camera_from_base)
    return expose(_averaged(target, camera), optics, seed)


def expose(image: Image, optics: Optics, seed: int = 0) -> Image:
    """The exact `image` (h, w, 3) as the camera would give it: blurred, with glare, brightness and noise."""
    if optics.blur > 0.0:
        image = cv2.GaussianBlur(image, (0, 0), optics.blur)
    if any(optics.motion):
        image = cv2.filter2D(image, -1, _motion_kernel(optics.motion))
    if optics.glare or optics.brightness != 1.0:
        lit = image.astype(np.float32) * optics.brightness + _glare(image.shape[:2], optics)[..., None]
        image = np.clip(lit, 0.0, 255.0).astype(np.uint8)
    if optics.noise > 0.0:
        image = _with_noise(image, optics.noise, seed)
    return image


def _averaged(target: _Target, camera: CameraInfo) -> Image:
    """(h, w, 3) the mean of the samples of each pixel. Four bytes a sample: numpy looks up words faster than rows."""
    colours = np.zeros((len(target.palette), 4), np.uint8)
    colours[:, :3] = target.palette
    samples = colours.view(np.uint32)[:, 0].take(target.index).view(np.uint8).reshape(*target.index.shape, 4)
    averaged: Image = cv2.resize(samples, (camera.width, camera.height), interpolation=cv2.INTER_AREA)[..., :3]
    return np.ascontiguousarray(averaged)


def _draw(target: _Target, solid: PosedSolid, camera_from_base: Rigid) -> None:
    turn, shift = _matrix(compose(camera_from_base, solid.pose))
    first, normals = _planes(solid.faces)
    turned = normals @ turn.T
    offsets = np.einsum("ij,ij->i", turned, first @ turn.T + shift)
    lights = normals @ (_matrix(solid.pose)[0].T @ LIGHT)
    for number in np.flatnonzero(offsets < -EDGE_ON):  # the others look away from the camera, or are seen edge on
        face = solid.faces[number]
        plane = turned[number] / offsets[number]
        _fill(target, face, face.corners @ turn.T + shift, plane, AMBIENT + (1.0 - AMBIENT) * max(0.0, lights[number]))


@lru_cache(maxsize=1024)
def _planes(faces: tuple[Face, ...]) -> tuple[Array, Array]:
    """A corner of each face and its outward unit normal, both (f, 3), in the solid's frame."""
    corners = np.array([face.corners[:3] for face in faces])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return corners[:, 0], normals / np.where(lengths > 0.0, lengths, 1.0)


def _fill(target: _Target, face: Face, corners: Array, plane: Array, light: float) -> None:
    """Draws a face whose points p have `plane` @ p = 1, in the optical frame."""
    if corners[:, 2].max() <= NEAR:
        return
    rows, columns = _window(target.lens, corners)
    x, y = target.lens.x[rows, columns], target.lens.y[rows, columns]
    if not x.size:
        return
    nearness = _linear(plane, x, y)
    held = target.nearness[rows, columns]
    seen = nearness > held
    if corners[:, 2].min() < NEAR:
        seen &= nearness < 1.0 / NEAR
    for edge in _edges_within(corners, target.lens, rows, columns):
        seen &= _linear(edge, x, y) >= 0.0
    np.copyto(held, nearness, where=seen)
    if face.texture is not None:
        target.index[rows, columns][seen] = _texels(face.texture, corners, x[seen], y[seen], nearness[seen])
        return
    np.copyto(target.index[rows, columns], np.uint16(len(target.palette)), where=seen)
    red, green, blue = face.colour
    target.palette.append((int(red * light), int(green * light), int(blue * light)))


def _edges_within(corners: Array, lens: Lens, rows: slice, columns: slice) -> Array:
    """(n, 3) for each edge that passes through the window: e @ (x, y, 1) >= 0 on its inner side.

    An edge with all of the window on its inner side need not be looked at: a linear function is least at a corner.
    """
    after = np.concatenate((corners[1:], corners[:1]))
    edges = np.empty_like(corners)  # after x corners
    for axis, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        edges[:, axis] = after[:, i] * corners[:, j] - after[:, j] * corners[:, i]
    x, y = lens.x_range[:, columns], lens.y_range[:, rows]
    least = np.minimum(edges[:, 0] * x[0].min(), edges[:, 0] * x[1].max()) + edges[:, 2]
    least += np.minimum(edges[:, 1] * y[0].min(), edges[:, 1] * y[1].max())
    within: Array = edges[least < 0.0]
    return within


def _window(lens: Lens, corners: Array) -> tuple[slice, slice]:
    if corners[:, 2].min() < NEAR:
        return slice(0, lens.x.shape[0]), slice(0, lens.x.shape[1])
    flat = corners[:, :2] / corners[:, 2:]
    return lens.window(flat.min(axis=0), flat.max(axis=0))


def _linear(factors: Array, x: Samples, y: Samples) -> Samples:
    """factors @ (x, y, 1) for every ray."""
    a, b, c = factors.astype(np.float32)
    value: Samples = x * a
    value += y * b
    value += c
    return value


def _texels(texture: NDArray[np.uint8], corners: Array, x: Samples, y: Samples, nearness: Samples) -> NDArray[np.uint8]:
    """The grey of each ray, where it pierces the parallelogram."""
    rows, columns = texture.shape
    down, right = corners[1] - corners[0], corners[3] - corners[0]
    along = np.linalg.inv(np.stack((down, right, np.cross(down, right)), axis=1))[:2]
    start = along @ corners[0]
    row, column = ((_linear(line, x, y) / nearness - at) for line, at in zip(along, start, strict=True))
    texels: NDArray[np.uint8] = texture[
        np.clip((row * rows).astype(np.intp), 0, rows - 1),
        np.clip((column * columns).astype(np.intp), 0, columns - 1),
    ]
    return texels


def _matrix(pose: Rigid) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) [m]."""
    x, y, z, w = pose[1]
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    return turn, np.array(pose[0])


def _motion_kernel(motion: tuple[float, float]) -> Samples:
    """A line of `motion` [px], centred, of sum 1."""
    steps = int(np.ceil(max(map(abs, motion))))
    kernel = np.zeros((2 * steps + 1, 2 * steps + 1), np.float32)
    for share in np.linspace(-0.5, 0.5, 16 * steps + 1):
        column, row = (share * each + steps for each in motion)
        i, j = int(row), int(column)
        for di, dj in ((0, 0), (0, 1), (1, 0), (1, 1)):
            weight = (1 - abs(row - i - di)) * (1 - abs(column - j - dj))
            if weight > 0.0:
                kernel[i + di, j + dj] += weight
    kernel /= kernel.sum()
    return kernel


def _glare(shape: tuple[int, ...], optics: Optics) -> Samples:
    v, u = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
    total: Samples = np.zeros(shape, np.float32)
    for column, row, spread in optics.glare:
        total += 255.0 * np.exp(-((u - column) ** 2 + (v - row) ** 2) / (2.0 * spread**2))
    return total


def _with_noise(image: Image, noise: float, seed: int) -> Image:
    """With a part of one large field of noise, which is drawn once: the seed says which part."""
    height, width = image.shape[:2]
    field = _field_of_noise(height + SHIFTS, width + SHIFTS, noise)
    row, column = divmod(seed * SPREADING % SHIFTS**2, SHIFTS)
    noisy: Image = cv2.add(image, field[row : row + height, column : column + width], dtype=cv2.CV_8U)
    return noisy


@lru_cache(maxsize=4)
def _field_of_noise(height: int, width: int, noise: float) -> NDArray[np.int16]:
    """OpenCV's generator is several times as fast as numpy's, and its seed is global to the process."""
    cv2.setRNGSeed(1)
    grain = np.empty((height, width, 3), np.int16)
    cv2.randn(grain, (0.0,) * 3, (noise,) * 3)
    return grain
