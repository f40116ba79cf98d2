"""docs/my_own_arm.md, walked through word by word: every command is typed, every line it shows is read."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import COMMAND, gemelo

ROOT = Path(__file__).parents[2]
ENGLISH, SPANISH = ROOT / "docs" / "my_own_arm.md", ROOT / "docs" / "es" / "mi_brazo.md"
NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "planner")
Session = list[tuple[str, list[str]]]  # what is typed, and the lines that it shows


def sessions(page: Path) -> Session:
    """Every command behind a $, with the lines below it."""
    found: Session = []
    for block in re.findall(r"```\n(.*?)```", page.read_text(), re.DOTALL):
        for line in block.splitlines():
            if line.startswith("$ "):
                found.append((line.removeprefix("$ "), []))
            elif block.startswith("$ "):
                found[-1][1].append(line)
    return found


def is_shown(wanted: list[str], said: list[str]) -> bool:
    """True if `said` are these lines, where "..." is any number of lines, and times differ."""
    if not wanted:
        return not said
    if wanted[0] == "...":
        return any(is_shown(wanted[1:], said[place:]) for place in range(len(said) + 1))
    return bool(said) and masked(wanted[0]) == masked(said[0]) and is_shown(wanted[1:], said[1:])


def masked(line: str) -> str:
    return re.sub(r": \d+\.\d s$", ": some s", line)


def test_both_languages_type_the_same():
    assert [typed for typed, _ in sessions(ENGLISH)] == [typed for typed, _ in sessions(SPANISH)]
    assert len(sessions(ENGLISH)) == 7


@pytest.mark.parametrize(("page", "language"), [(ENGLISH, "en"), (SPANISH, "es")])
def test_the_page_is_right_from_the_export_to_the_first_move_and_to_motors(page: Path, language: str, tmp_path: Path):
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    steps = sessions(page)
    place = [typed.startswith("gemelo move") for typed, _ in steps].index(True)
    moves = [(typed, shown) for typed, shown in steps if typed.startswith("gemelo move")]
    for typed, shown in steps[:place]:
        type_it(typed, shown, tmp_path, language)
    environment = {"GEMELO_ROBOT": str(tmp_path / "urdf" / "my_arm")}
    with Stack(out=tmp_path / "out" / "run", processes=NEEDED, environment=environment) as stack:
        for typed, shown in moves:
            said = gemelo(stack, "--lang", language, *shlex.split(typed)[1:])
            assert is_shown(shown, said.splitlines()), typed
    for typed, shown in steps[place + len(moves) :]:
        type_it(typed, shown, tmp_path, language)


def type_it(typed: str, shown: list[str], folder: Path, language: str) -> None:
    """Runs it in `folder`, in a terminal of that language; it must print what the page shows."""
    program, *words = shlex.split(typed)
    command = [sys.executable, *words] if program == "python" else [*COMMAND, *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "LANG": language}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert is_shown(shown, done.stdout.splitlines()), f"{typed}:\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("page", [ENGLISH, SPANISH])
def test_every_key_of_a_message_and_every_link_is_there(page: Path):
    for target in re.findall(r"\]\(([^)#]+)", page.read_text()):
        assert (page.parent / target).exists(), target
