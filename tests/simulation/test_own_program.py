"""docs/test_your_program.md and its Spanish twin, as printed: its files are written, and pytest runs them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = (DOCS / "test_your_program.md", DOCS / "es/probar_mi_programa.md")
FILE = re.compile(r"```python\n# (\w+\.py)\n(.*?)```", re.DOTALL)


def files(page: Path) -> dict[str, str]:
    return dict(FILE.findall(page.read_text(encoding="utf-8")))


def run_pytest(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """pytest as a user starts it, in a folder of his own."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    environ = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST")}
    return subprocess.run(command, cwd=folder, env=environ, capture_output=True, text=True, timeout=120, check=False)


def test_what_is_printed_is_green(tmp_path: Path) -> None:
    for name, text in files(PAGES[0]).items():
        (tmp_path / name).write_text(text)
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "4 passed" in done.stdout
    assert {each.name for each in tmp_path.iterdir()} - {"__pycache__"} == set(files(PAGES[0]))


def test_both_languages_print_the_same_files() -> None:
    assert files(PAGES[0]) == files(PAGES[1])


@pytest.mark.parametrize(
    ("configuration", "marker", "name"),
    [
        ("gemelo_start = left", "", "rm1"),
        ("gemelo_robot = parol6\ngemelo_seed = 7", "", "parol6"),
        ("gemelo_robot = parol6", '@pytest.mark.gemelo("rm1")', "rm1"),
    ],
)
def test_configuration_and_marker_choose_the_arm(configuration: str, marker: str, name: str, tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text(f"[pytest]\naddopts = --strict-markers\n{configuration}\n")
    (tmp_path / "test_which.py").write_text(
        f"import pytest\n\n{marker}\ndef test_which(arm):\n    assert arm.name == {name!r}\n"
        + ('    assert arm.joints["brazo_joint"] > 0.5\n' if "start" in configuration else "")
    )
    done = run_pytest(tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_seed_that_is_no_number_is_said(tmp_path: Path) -> None:
    (tmp_path / "pytest.ini").write_text("[pytest]\ngemelo_seed = one\n")
    (tmp_path / "test_which.py").write_text("def test_which(arm):\n    pass\n")
    done = run_pytest(tmp_path)
    assert done.returncode != 0
    assert "gemelo_seed = one: it must be a whole number" in done.stdout + done.stderr
