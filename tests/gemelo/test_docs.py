"""The package's documents agree with the package."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

import gemelo


@pytest.mark.parametrize("page", ["docs/python.md", "docs/es/python.md"])
def test_the_script_of_the_page_runs(
    arm: gemelo.Arm, root: Path, capsys: pytest.CaptureFixture[str], page: str
) -> None:
    [code] = re.findall(r"```python\n(.*?)```", (root / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    exec(compile(code, page, "exec"), {})
    printed = capsys.readouterr().out
    assert "refused (reach)" in printed
    assert "nearest that can: position=(0.4" in printed


def test_the_pages_of_the_planners_are_those_of_their_table(root: Path) -> None:
    for file, text in runpy.run_path(str(root / "docs/make_planners.py"))["pages"]().items():
        assert file.read_text(encoding="utf-8") == text, "run `make docs`"
