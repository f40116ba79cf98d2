"""The block that is drawn again in its place, held against a terminal of a few lines."""

from __future__ import annotations

import re

from gemelo.tools.cli.common.terminal import LiveBlock


def screen(written: str) -> list[str]:
    """What a terminal shows that knows "up so many lines" and "clear from here"."""
    lines, row = [""], 0
    for part in re.split(r"(\x1b\[\d+F|\x1b\[J|\n)", written):
        if up := re.fullmatch(r"\x1b\[(\d+)F", part):
            row -= int(up[1])
        elif part == "\x1b[J":
            lines = [*lines[:row], ""]
        elif part == "\n":
            row += 1
            lines += [""] * (row + 1 - len(lines))
        else:
            lines[row] += part
    return lines[:-1]


def test_lines_stay_above_the_newest_block(capsys):
    block = LiveBlock(is_live=True)
    for second in range(3):
        block.say(f"line {second}")
        block.draw(f"\nblock {second}\nend {second}")
    written = capsys.readouterr().out
    assert screen(written) == ["line 0", "line 1", "line 2", "", "block 2", "end 2"]
    block.say()
    assert screen(written + capsys.readouterr().out) == ["line 0", "line 1", "line 2"]


def test_a_line_that_would_wrap_is_cut(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "20")
    monkeypatch.setenv("LINES", "3")
    LiveBlock(is_live=True).draw("x" * 50 + "\nshort\nno room")
    assert screen(capsys.readouterr().out) == ["x" * 19, "short"]


def test_in_a_pipe_there_is_no_block(capsys):
    block = LiveBlock()
    block.draw("block")
    block.say("line")
    assert capsys.readouterr().out == "line\n"
