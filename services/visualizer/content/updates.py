"""The updates of the view: typed columns for entities, independent of Rerun. Times are in [ns] UNIX."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from gemelo.schemas.message import Vector
from gemelo.services.visualizer.content.palette import Rgba
from gemelo.services.visualizer.model.rotations import Array
from gemelo.services.visualizer.model.triangle_meshes import ShadedMesh

Times = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Scalars:
    """Values (n, series) at times (n,)."""

    entity: str
    times: Times
    values: Array


@dataclass(frozen=True)
class Poses:
    """Translations (n, 3) [m] and quaternions (n, 4) x y z w in the parent entity, at times (n,)."""

    entity: str
    times: Times
    translations: Array
    rotations: Array


@dataclass(frozen=True)
class LineStrip:
    """A line through points (n, 3) [m] in the root frame."""

    entity: str
    time: int
    points: Array


@dataclass(frozen=True)
class TextPanel:
    """A text in Markdown that replaces the previous one."""

    entity: str
    time: int
    markdown: str


@dataclass(frozen=True)
class LogLines:
    """Lines with their levels (as in `LogLevel`'s names)."""

    entity: str
    times: Times
    texts: tuple[str, ...]
    levels: tuple[str, ...]


@dataclass(frozen=True)
class StateUpdate:
    """A named state that lasts until the next."""

    entity: str
    time: int
    state: str


@dataclass(frozen=True)
class Tint:
    """The arm under `entity` as it looks in a mode of the device."""

    entity: str
    time: int
    mode: str


@dataclass(frozen=True)
class SolidMesh:
    """A solid at a pose in its parent entity: (3,) [m] and quaternion (4,) x y z w; its colour with alpha."""

    entity: str
    time: int
    mesh: ShadedMesh
    translation: Vector
    rotation: Vector
    color: Rgba


@dataclass(frozen=True)
class ClearEntity:
    """An entity and all below it that are no longer there."""

    entity: str
    time: int


@dataclass(frozen=True)
class Labels:
    """Texts at points (n, 3) [m] in the root frame."""

    entity: str
    time: int
    points: Array
    texts: tuple[str, ...]


@dataclass(frozen=True)
class TranslucentArm:
    """A translucent arm under `entity`, with the links `touching` in red; `Poses` say its configuration."""

    entity: str
    time: int
    touching: frozenset[str]
    color: Rgba


@dataclass(frozen=True)
class PictureUpdate:
    """A JPEG that replaces the previous one."""

    entity: str
    time: int
    jpeg: bytes


@dataclass(frozen=True)
class Frustum:
    """What a camera sees: its pose in its parent entity, (3,) [m] and quaternion (4,) x y z w, and its lens.

    `intrinsics` (9,) [px] is the matrix K row by row, for images of `size` [px].
    """

    entity: str
    time: int
    translation: Vector
    rotation: Vector
    intrinsics: Vector
    size: tuple[int, int]


@dataclass(frozen=True)
class Outlines:
    """Lines (n, 2) [px] in an image, each with its text; none takes the previous ones away."""

    entity: str
    time: int
    strips: tuple[Array, ...]
    texts: tuple[str, ...]


Update: TypeAlias = (
    Scalars
    | Poses
    | LineStrip
    | TextPanel
    | LogLines
    | StateUpdate
    | Tint
    | SolidMesh
    | ClearEntity
    | Labels
    | TranslucentArm
    | PictureUpdate
    | Frustum
    | Outlines
)
