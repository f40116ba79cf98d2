"""The serial line between gateway and device: what passes, and what does not."""

from __future__ import annotations

import os
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from random import Random

import pytest

from gemelo.tools.chaos.noisy_line import NoisyLine, spoiled
from tests.runtime.support import until

FRAME = bytes(range(200))


class Board:
    """The device's end of a pseudo-terminal whose other one is at `path`."""

    def __init__(self, path: Path) -> None:
        self.end, self._other = os.openpty()
        tty.setraw(self._other)
        path.symlink_to(os.ttyname(self._other))

    def close(self) -> None:
        for end in (self.end, self._other):
            os.close(end)


@pytest.fixture
def board(tmp_path: Path) -> Iterator[Board]:
    board = Board(tmp_path / "tty")
    yield board
    board.close()


@pytest.fixture
def line(board: Board, tmp_path: Path) -> Iterator[NoisyLine]:
    line = NoisyLine(tmp_path / "tty", seed=1)
    yield line
    with suppress(OSError):
        line.close()


def opened(path: Path) -> int:
    return os.open(path, os.O_RDWR | os.O_NOCTTY)


def test_everything_passes_both_ways(board: Board, line: NoisyLine, tmp_path: Path) -> None:
    host = opened(tmp_path / "tty")
    os.write(host, FRAME)
    assert os.read(board.end, 4096) == FRAME
    os.write(board.end, FRAME[::-1])
    assert os.read(host, 4096) == FRAME[::-1]
    os.close(host)


def test_a_garbled_line_changes_a_bit_and_a_lossy_one_loses_bytes(
    board: Board, line: NoisyLine, tmp_path: Path
) -> None:
    host = opened(tmp_path / "tty")
    line.garbling = 1.0
    os.write(host, FRAME)
    seen = os.read(board.end, 4096)
    assert len(seen) == len(FRAME)
    assert sum((one ^ other).bit_count() for one, other in zip(seen, FRAME, strict=True)) == 1
    line.heal()
    line.losing = 1.0
    os.write(host, FRAME)
    assert len(os.read(board.end, 4096)) < len(FRAME)
    line.heal()
    os.write(host, FRAME)
    assert os.read(board.end, 4096) == FRAME
    os.close(host)


def test_an_unplugged_line_fails_for_who_has_it_open_and_is_there_again(
    board: Board, line: NoisyLine, tmp_path: Path
) -> None:
    host = opened(tmp_path / "tty")
    line.unplug()
    with pytest.raises(OSError, match="Input/output error"):
        os.write(host, FRAME)
    os.close(host)
    assert not (tmp_path / "tty").is_symlink()
    os.write(board.end, FRAME)  # which nobody gets
    line.heal()
    host = opened(tmp_path / "tty")
    os.write(host, FRAME)
    assert os.read(board.end, 4096) == FRAME
    os.close(host)


def test_a_line_that_is_closed_leaves_no_path_and_no_thread(line: NoisyLine, tmp_path: Path) -> None:
    line.close()
    assert not (tmp_path / "tty").is_symlink()
    assert until(lambda: not line.is_running, 60.0)


def test_a_line_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        NoisyLine(tmp_path / "tty")


def test_the_shares_of_pieces_are_as_they_were_set() -> None:
    random = Random(1)
    pieces = [spoiled(FRAME, random, losing=0.1, garbling=0.0) for _ in range(1000)]
    assert 60 < sum(len(piece) < len(FRAME) for piece in pieces) < 140
    pieces = [spoiled(FRAME, random, losing=0.0, garbling=0.1) for _ in range(1000)]
    assert 60 < sum(piece != FRAME for piece in pieces) < 140
    assert all(spoiled(piece, random, 1.0, 1.0) != FRAME for piece in (b"", FRAME))
