"""The pictures of `make picture` become one GIF: none twice, and none that stays long."""

from __future__ import annotations

import io
import runpy
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image

ROOT = Path(__file__).parents[2]
make_picture = SimpleNamespace(**runpy.run_path(str(ROOT / "docs/make_picture.py")))


class Colours:
    """A page that shows one colour after the other."""

    def __init__(self, *shown: str) -> None:
        self._shown = list(shown)

    def screenshot(self) -> bytes:
        """A PNG of the next one."""
        file = io.BytesIO()
        Image.new("RGB", (40, 30), self._shown.pop(0)).save(file, "PNG")
        return file.getvalue()


@pytest.fixture
def moving(tmp_path: Path) -> Iterator[Image.Image]:
    """Written of a page that stands still for a while, and for a minute before its last picture."""
    film = make_picture.Film(Colours("red", "red", "green", "green", "blue"))
    for _ in range(5):
        film.take()
    moments = (0.0, 0.3, 60.3)  # [s]
    film.taken = [(moment, picture) for moment, (_, picture) in zip(moments, film.taken, strict=True)]
    film.write(tmp_path / "move.gif")
    with Image.open(tmp_path / "move.gif") as moving:
        yield moving


def test_a_picture_that_shows_nothing_new_is_left_out_and_none_stays_long(moving: Image.Image) -> None:
    stays, colours = [], []
    for number in range(moving.n_frames):
        moving.seek(number)
        stays.append(moving.info["duration"])
        colours.append(moving.convert("RGB").getpixel((20, 15)))
    assert stays == [make_picture.FIRST, make_picture.LONGEST, make_picture.LAST]
    assert [colour.index(max(colour)) for colour in colours] == [0, 1, 2]


def test_it_begins_anew_by_itself(moving: Image.Image) -> None:
    assert moving.info["loop"] == 0
