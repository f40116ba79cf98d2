"""The header of an ONNX file, whatever is in the file."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gemelo.services.detector.onnx_header import Header, NotOnnx, read_header
from tests.detector.onnx_file import red_finder
from tests.table import table

SIZE = 32
WHATEVER = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


@table("said", [(1, 3, SIZE, SIZE), (0, 3, 0, 0), (1, 3, 480, 640), (7,)])
@table(
    ("names", "read"),
    [
        ("{0: 'cup', 1: \"a mug's\"}", {0: "cup", 1: "a mug's"}),
        ("['cup', 'mug']", {0: "cup", 1: "mug"}),
        ("", {}),
        ("__import__('os')", {}),
        ("{'cup': 0}", {}),
        ("(" * 5000, {}),
    ],
)
def test_sizes_and_names_are_read(tmp_path: Path, said: tuple[int, ...], names: str, read: dict[int, str]) -> None:
    path = red_finder(tmp_path / "red.onnx", SIZE, said=said, names=names)
    assert read_header(path) == Header(said, read)


@WHATEVER
@given(content=st.binary(max_size=300))
def test_any_bytes_are_a_header_or_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "any.onnx"
    path.write_bytes(content)
    with contextlib.suppress(NotOnnx):
        read_header(path)


@WHATEVER
@given(share=st.floats(0.0, 0.999))
def test_a_file_that_was_cut_is_refused(tmp_path: Path, share: float) -> None:
    path = red_finder(tmp_path / "red.onnx", SIZE)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * (len(whole) - 60))])
    with pytest.raises(NotOnnx):
        read_header(path)
