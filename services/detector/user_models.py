"""Models of users: ONNX files in a layout of YOLO, run by OpenCV on the processor.

Layouts, told apart by their shape: (1, 4 + classes, n) of YOLOv8 and later, with centre and size of each box and a
score for each class; (1, n, 5 + classes) of YOLOv5 and v7, with a score of its own for "something"; and (1, n, 6) with
at most 1,000 boxes of models that suppress doubles themselves: two corners, score, class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from gemelo.libraries.vision.boxes import ColourImage, project_box, raised
from gemelo.libraries.vision.camera_model import CameraModel
from gemelo.libraries.vision.rigid import Array
from gemelo.libraries.vision.tag_pose import flat, on_plane
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, Value, because, plain, remedy
from gemelo.services.detector.onnx_header import Header, NotOnnx, read_header

GREY = 114  # of the border around an image that is not square, as YOLO is trained
SAME = 0.45  # overlap from which on two boxes of a class are one
MOST_FINAL = 1_000  # boxes of a model that suppresses doubles itself
MOST_NAMED = 20  # classes in a sentence
SLACK = 1e-3  # of a score beyond 0 and 1, by rounding
PIXELS = 2.0  # [px] standard deviation of a side of a box; chosen
LIKE_SIZE = (0.6, 1.6)  # of a found box's edges to those of the thing where it would stand
TURNS = np.linspace(0.0, np.pi, 12, endpoint=False)  # [rad] that are tried
ROUNDS = 4
NUDGE = 1e-5  # [m] for differences


class BadModel(ReasonedError, ValueError):
    """A file that is no such model; the reason has the remedy."""


@dataclass(frozen=True)
class Found:
    """A box in an image."""

    label: int
    score: float
    sides: Array  # (4,) [px] left, upper, right, lower


@dataclass(frozen=True)
class PlacedThing:
    """Where a thing stands whose box in the image is known."""

    plane_from_box: Array  # (4, 4) of the middle of the thing
    sigma: float  # [m]


class UserModel:
    """One ONNX file; raises `BadModel` where it cannot be read, or answers an empty image as no YOLO does."""

    def __init__(self, path: Path, size: int) -> None:
        """`size` [px]: the edge of the square image that it takes."""
        self._path, self._size = path, size
        header = _required_header(path, size)
        self._names, self._is_open = header.names, not all(header.sizes[1:])
        self._classes = 0  # 0: its layout does not tell
        try:
            self._net = cv2.dnn.readNetFromONNX(str(path))
        except cv2.error as error:
            why = self._if_open() or because("model.opencv", remedy("export_opset"), error=_first_line(error))
            raise BadModel(because("model.unreadable", why, file=str(path))) from error
        self._require_shares(self._run(np.full((size, size, 3), GREY, dtype=np.uint8))[1])

    def number_of(self, label: int | str) -> int:
        """Of the class that is called or numbered so; raises `BadModel` where the model has none."""
        file = str(self._path)
        known = tuple(f"{number} {name}" for number, name in sorted(self._names.items())[:MOST_NAMED])
        if isinstance(label, str):
            found = [number for number, name in self._names.items() if name == label]
            if not self._names:
                raise BadModel(because("model.class.unnamed", remedy("write_number", label=label), file=file))
            if not found:
                raise BadModel(because("model.class.name", file=file, label=label, classes=known))
            return found[0]
        is_beyond = label >= self._classes > 0
        if self._names and (is_beyond or label not in self._names):
            raise BadModel(because("model.class.number", file=file, label=label, classes=known))
        if is_beyond:
            raise BadModel(because("model.class.beyond", file=file, label=label, count=self._classes))
        return label

    def look(self, image: ColourImage, threshold: float) -> list[Found]:
        """What is in `image` (h, w, 3; red first) with at least that score; raises `BadModel`."""
        return without_doubles(*self._run(image), threshold)

    def _run(self, image: ColourImage) -> tuple[Array, Array]:
        """(n, 4) sides [px of the image], and (n, classes) scores."""
        scale = self._size / max(image.shape[:2])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        square = np.full((self._size, self._size, 3), GREY, dtype=np.uint8)
        square[: small.shape[0], : small.shape[1]] = small
        try:
            self._net.setInput(cv2.dnn.blobFromImage(square, 1.0 / 255.0))
            said = np.asarray(self._net.forward(), dtype=np.float64)
        except cv2.error as error:
            about: dict[str, Value] = {"file": str(self._path), "size": self._size, "error": _first_line(error)}
            if (is_open := self._if_open()) is not None:
                raise BadModel(because("model.size.open", is_open, **about)) from error
            raise BadModel(because("model.size", remedy("write_exported_size"), **about)) from error
        sides, scores = self._boxes(said)
        return (sides + 0.5) / scale - 0.5, scores

    def _if_open(self) -> Reason | None:
        """Of many models that leave the size of their images open OpenCV cannot work out the shapes within."""
        return because("model.open", remedy("export_one_size", size=self._size)) if self._is_open else None

    def _boxes(self, said: Array) -> tuple[Array, Array]:
        """(n, 4) sides [px of the square], and (n, classes) scores."""
        table = said[0] if said.ndim == 3 and said.shape[0] == 1 else np.empty((0, 0))
        rows, columns = table.shape
        if columns == 6 and 0 < rows <= MOST_FINAL:
            labels = np.clip(table[:, 5].astype(int), 0, None)
            return table[:, :4], np.eye(int(labels.max()) + 1)[labels] * table[:, 4:5]
        if 4 < rows < columns:
            self._require_classes(rows - 4)
            return _sides(table[:4].T), table[4:].T
        if 5 < columns < rows:
            self._require_classes(columns - 5)
            return _sides(table[:, :4]), table[:, 5:] * table[:, 4:5]
        raise BadModel(because("model.layout", file=str(self._path), shape=str(tuple(said.shape))))

    def _require_classes(self, scores: int) -> None:
        """Models of outlines, poses and turned boxes say more numbers a box than they have classes."""
        self._classes = scores
        if self._names and len(self._names) != scores:
            why = because("model.task", file=str(self._path), scores=scores, classes=len(self._names))
            raise BadModel(why)

    def _require_shares(self, scores: Array) -> None:
        if not np.isfinite(scores).all() or scores.min(initial=0.0) < -SLACK or scores.max(initial=0.0) > 1.0 + SLACK:
            least, most = float(scores.min()), float(scores.max())
            last = remedy("export_last_layer")
            raise BadModel(because("model.scores", last, file=str(self._path), least=least, most=most))


def _required_header(path: Path, size: int) -> Header:
    """What the file says of itself; raises `BadModel` where it takes no square images of `size` [px]."""
    try:
        header = read_header(path)
    except (OSError, NotOnnx) as error:
        why = error.reason if isinstance(error, NotOnnx) else plain(str(error))
        raise BadModel(because("model.unreadable", because("model.not_onnx", why), file=str(path))) from error
    if len(header.sizes) != 4:
        raise BadModel(because("model.dimensions", file=str(path), count=len(header.sizes)))
    _, channels, height, width = header.sizes
    if channels not in (0, 3):
        raise BadModel(because("model.channels", file=str(path), channels=channels))
    edges = {height, width} - {0}
    if len(edges) > 1:
        square = remedy("export_square", size=size)
        raise BadModel(because("model.not_square", square, file=str(path), width=width, height=height))
    if edges and edges != {size}:
        (edge,) = edges
        write = remedy("write_input", size=edge)
        raise BadModel(because("model.other_size", write, file=str(path), edge=edge, size=size))
    return header


def standing(found: Found, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> PlacedThing | None:
    """Where on the plane a thing of edges `size` (3,) [m] stands that fills the box; None if none of that size does.

    How it is turned is only known as far as the box's shape says it: a square one stands along the axes.
    """
    if found.sides[2] - found.sides[0] < 1.0 or found.sides[3] - found.sides[1] < 1.0:
        return None
    turns = TURNS[:1] if abs(size[0] - size[1]) < 1e-3 * max(size) else TURNS
    fits = [_fit(found.sides, float(turn), model, camera_from_plane, size) for turn in turns]
    error, values, slope = min(fits, key=lambda each: each[0])
    sides = projected_box(values, model, camera_from_plane, size)
    shares = (found.sides[2:] - found.sides[:2]) / (sides[2:] - sides[:2])
    if not np.isfinite(values).all() or shares.min() < LIKE_SIZE[0] or shares.max() > LIKE_SIZE[1]:
        return None
    covariance = np.linalg.inv(slope.T @ slope) * max(error, PIXELS) ** 2
    pose = flat(values)
    pose[2, 3] = size[2] / 2.0
    return PlacedThing(pose, float(np.sqrt(covariance[0, 0] + covariance[1, 1])))


def _fit(
    sides: Array, turn: float, model: CameraModel, camera_from_plane: Array, size: Sequence[float]
) -> tuple[float, Array, Array]:
    """RMS [px], x, y [m] and turn [rad], and how the sides (4,) move with x and y."""
    middle = np.array([[(sides[0] + sides[2]) / 2.0, (sides[1] + sides[3]) / 2.0]])
    seed = on_plane(model.rays(middle), raised(camera_from_plane, size[2] / 2.0))[0]
    values = np.array([seed[0], seed[1], turn])
    slope = np.zeros((4, 2))
    for _ in range(ROUNDS):
        here = projected_box(values, model, camera_from_plane, size)
        for axis in range(2):
            ahead = values.copy()
            ahead[axis] += NUDGE
            slope[:, axis] = (projected_box(ahead, model, camera_from_plane, size) - here) / NUDGE
        values[:2] += np.linalg.lstsq(slope, sides - here, rcond=None)[0]
    off = sides - projected_box(values, model, camera_from_plane, size)
    return float(np.sqrt(np.mean(off**2))), values, slope


def projected_box(values: Array, model: CameraModel, camera_from_plane: Array, size: Sequence[float]) -> Array:
    """(4,) [px] left, upper, right and lower side of the box in the image around a thing of `size` [m], whose `values`
    are x and y [m] on the plane and yaw [rad]; `camera_from_plane` is (4, 4)."""
    pixels = project_box(values, model, camera_from_plane, size)
    return np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])


def _sides(boxes: Array) -> Array:
    """From centres and sizes (n, 4)."""
    return np.column_stack([boxes[:, :2] - boxes[:, 2:] / 2.0, boxes[:, :2] + boxes[:, 2:] / 2.0])


def without_doubles(sides: Array, scores: Array, threshold: float) -> list[Found]:
    """Of boxes with `sides` (n, 4) [px] and `scores` (n, labels), 0 to 1, those that reach the threshold, each thing
    once."""
    labels = scores.argmax(axis=1)
    best = scores[np.arange(len(scores)), labels]
    found = []
    for label in np.unique(labels[best >= threshold]):
        chosen = np.flatnonzero((labels == label) & (best >= threshold))
        boxes = [(x, y, right - x, lower - y) for x, y, right, lower in sides[chosen].tolist()]
        kept = np.asarray(cv2.dnn.NMSBoxes(boxes, best[chosen].tolist(), threshold, SAME), dtype=int).ravel()
        found += [Found(int(label), float(best[chosen[index]]), sides[chosen[index]]) for index in kept]
    return found


def _first_line(error: cv2.error) -> str:
    return str(error).strip().splitlines()[0][:120]
