"""Triangles of an STL file, binary or text, with equal corners merged."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because, remedy

HEADER, ROW = 80, 50  # bytes: free text; a normal, three corners and two more
MAX_TRIANGLES = 500_000


class BadStl(ReasonedError, ValueError):
    """A file that holds no triangles; the reason says why."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """`vertices` (v, 3) in the file's units, `faces` (f, 3) vertex numbers."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int32]


def read_stl(content: bytes) -> Triangles:
    """The file's triangles without those that have no area; raises `BadStl`."""
    corners = _binary(content) if _is_binary(content) else _text(content)
    if not len(corners):
        raise BadStl(because("stl.empty"))
    if len(corners) > MAX_TRIANGLES:
        raise BadStl(because("stl.large", remedy("simplify_it"), count=len(corners), limit=MAX_TRIANGLES))
    if not np.isfinite(corners).all():
        raise BadStl(because("stl.not_finite"))
    vertices, numbers = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = numbers.reshape(-1, 3).astype(np.int32)
    first, second, third = faces.T
    faces = faces[(first != second) & (second != third) & (third != first)]
    if not len(faces):
        raise BadStl(because("stl.flat"))
    return Triangles(np.ascontiguousarray(vertices), np.ascontiguousarray(faces))


def _is_binary(content: bytes) -> bool:
    """By its length alone: many binary files begin with "solid" as text ones do."""
    if len(content) < HEADER + 4:
        return False
    (count,) = struct.unpack_from("<I", content, HEADER)
    return len(content) == HEADER + 4 + ROW * int(count)


def _binary(content: bytes) -> NDArray[np.float64]:
    """(f, 3, 3) corners."""
    rows = np.frombuffer(content, dtype=np.uint8, offset=HEADER + 4).reshape(-1, ROW)
    numbers = np.ascontiguousarray(rows[:, 12:48]).view("<f4")
    return numbers.reshape(-1, 3, 3).astype(np.float64)


def _text(content: bytes) -> NDArray[np.float64]:
    """(f, 3, 3) corners; every `facet` has an outer loop of three `vertex` lines."""
    if not content.lstrip()[:5].lower() == b"solid":
        raise BadStl(because("stl.kind", size=len(content)))
    lines = [line.split() for line in content.decode("utf-8", "replace").splitlines()]
    vertices = [words[1:] for words in lines if words and words[0].lower() == "vertex"]
    if len(vertices) % 3:
        raise BadStl(because("stl.cut_off", count=len(vertices)))
    try:
        return np.array([[float(x), float(y), float(z)] for x, y, z in vertices]).reshape(-1, 3, 3)
    except ValueError as error:
        raise BadStl(because("stl.vertex", detail=str(error))) from None
