"""Control characters in names, logs and messages of others: no command writes them to the terminal."""

from __future__ import annotations

import io
import json
import re
import sys
from pathlib import Path

import msgspec
import pytest

from gemelo.libraries.runtime.process.logs import line_logger
from gemelo.schemas.plain_text import escaped, escaped_but_colours
from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.tools.cli.bus.messages import dump
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.common.output import EscapedStream, control, escaped_output, print_coloured
from gemelo.tools.cli.common.terminal import LiveBlock
from gemelo.tools.cli.main import run
from gemelo.tools.cli.watch.log import line_of

CLIPBOARD = "\x1b]52;c;cm0gLXJmIH4=\x07"  # what a terminal puts into its clipboard
ATTACKS = (
    CLIPBOARD,
    "\x9b2J",
    "\x08" * 9,
    "\x1b[2J",
    "\rgemelo: all is well",
    "a\u202egnp.exe",
    "\u2066x\u2069",
    "\x7f",
)
ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("attack", ATTACKS)
def test_text_of_others_is_printed_without_its_control_characters(attack: str, capsys: pytest.CaptureFixture[str]):
    record = LogRecord(stamp=0, node=f"planner{attack}", level=LogLevel.INFO, text=attack)
    print(line_of(record))
    assert attack in capsys.readouterr().out, "what the terminal gets without the lock"
    with escaped_output():
        print(line_of(record))
        print(dump({"name": attack, attack: [attack]}))
        print(attack, file=sys.stderr)
        LiveBlock(is_live=True).draw(f"{attack} is sent")
    shown = "".join(capsys.readouterr())
    assert escaped(shown) == shown
    assert f"planner{escaped(attack)}: {escaped(attack)}" in shown
    line_logger("planner").warning("dropped a message of %s", attack)
    assert escaped(attack) in capsys.readouterr().err


def test_a_failure_names_what_was_given_without_its_control_characters(capsys: pytest.CaptureFixture[str]):
    for arguments in (["--robot", f"a{CLIPBOARD}", "state"], ["bag", "info", f"a{CLIPBOARD}"], ["import", CLIPBOARD]):
        assert run(arguments) is not ExitCode.OK
        shown = "".join(capsys.readouterr())
        assert escaped(CLIPBOARD) in shown
        assert escaped(shown) == shown


def test_json_means_the_same(capsys: pytest.CaptureFixture[str]):
    said = {"name": "".join(ATTACKS), "lines": "a\tb\nc", "word": "ñ 北 ▲"}
    with escaped_output():
        print(msgspec.json.encode(said).decode())
    shown = capsys.readouterr().out
    assert json.loads(shown) == said
    assert escaped(shown) == shown


def test_our_own_sequences_pass_and_colours_alone_within_a_drawing(capsys: pytest.CaptureFixture[str]):
    with escaped_output():
        control("\x1b[2F\x1b[J")
        print_coloured(f"\x1b[31mcurve{CLIPBOARD}\x1b[0m")
    assert capsys.readouterr().out == f"\x1b[2F\x1b[J\x1b[31mcurve{escaped(CLIPBOARD)}\x1b[0m\n"
    assert escaped_but_colours("\x1b[38;2;1;2;3m▀") == "\x1b[38;2;1;2;3m▀"


def test_what_writes_past_it_is_one_module():
    """Any other print of a command goes through the stream that escapes."""
    past = re.compile(r"__stdout__|__stderr__|\.unescaped|stdout\.buffer|os\.write\((1|2),|fdopen\((1|2)")
    found = {path.name for path in (ROOT / "tools" / "cli").rglob("*.py") if past.search(path.read_text())}
    assert found == {"output.py"}


def test_it_is_put_back_and_passes_on_what_a_stream_has(monkeypatch: pytest.MonkeyPatch):
    stream = io.StringIO()
    monkeypatch.setattr("sys.stdout", stream)
    with escaped_output():
        with escaped_output():
            print("a\x1b", end="")
        assert isinstance(sys.stdout, EscapedStream)
        assert not sys.stdout.isatty()
    assert sys.stdout is stream
    assert stream.getvalue() == "a\\u001b"
