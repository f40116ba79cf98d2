"""STL files in both forms, and everything that only looks like one."""

from __future__ import annotations

import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.stl import BadStl, read_stl

TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=float)


def binary(triangles: np.ndarray, header: bytes = b"") -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *triangle.ravel(), 0) for triangle in triangles)
    return header.ljust(80, b"\0") + struct.pack("<I", len(triangles)) + rows


def text(triangles: np.ndarray) -> bytes:
    facets = (
        "facet normal 0 0 1\n outer loop\n"
        + "".join(f"  vertex {x:g} {y:g} {z:g}\n" for x, y, z in triangle)
        + " endloop\nendfacet\n"
        for triangle in triangles
    )
    return f"solid part\n{''.join(facets)}endsolid part\n".encode()


@pytest.mark.parametrize("content", [binary(TRIANGLES), binary(TRIANGLES, b"solid but binary"), text(TRIANGLES)])
def test_both_forms_give_the_same_triangles_with_shared_corners(content: bytes) -> None:
    triangles = read_stl(content)
    assert len(triangles.vertices) == 4
    assert triangles.vertices[triangles.faces].tolist() == TRIANGLES.tolist()


def test_triangles_without_an_area_are_left_out() -> None:
    flat = np.array([[[0, 0, 0], [0, 0, 0], [1, 1, 1]]], dtype=float)
    assert len(read_stl(binary(np.concatenate([TRIANGLES, flat]))).faces) == 2
    with pytest.raises(BadStl, match="none of its triangles has an area"):
        read_stl(binary(flat))


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "no STL file: 0 bytes"),
        (b"glTF\0\0\0", "no STL file"),
        (binary(TRIANGLES)[:-1], "no STL file"),
        (binary(TRIANGLES[:0]), "holds no triangle"),
        (b"solid empty\nendsolid\n", "holds no triangle"),
        (text(TRIANGLES).replace(b"vertex 0 1 0", b"", 1), "was it cut off"),
        (text(TRIANGLES).replace(b"vertex 0 1 0", b"vertex 0 one 0"), "not three numbers"),
        (text(TRIANGLES).replace(b"vertex 0 1 0", b"vertex 0 1"), "not three numbers"),
        (text(TRIANGLES).replace(b"vertex 0 1 0", b"vertex 0 nan 0"), "not finite"),
    ],
)
def test_what_is_no_mesh_says_why(content: bytes, reason: str) -> None:
    with pytest.raises(BadStl, match=reason):
        read_stl(content)


@given(st.one_of(st.binary(max_size=300), st.binary(max_size=100).map(lambda tail: b"solid " + tail)))
def test_no_bytes_bring_it_down(content: bytes) -> None:
    with suppress(BadStl):
        assert len(read_stl(content).faces) > 0
