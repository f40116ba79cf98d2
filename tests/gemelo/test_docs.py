"""The package's documents agree with the package."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

import gemelo
from tests.gemelo.public import documented, own_names


def test_the_api_page_is_up_to_date(root: Path) -> None:
    page = runpy.run_path(str(root / "docs/make_api.py"))["page"]()
    assert (root / "docs/api.md").read_text(encoding="utf-8") == page, "run `make docs`"


def test_the_api_page_tells_of_every_public_name(root: Path) -> None:
    headings = [line for line in (root / "docs/api.md").read_text().splitlines() if line.startswith("###")]
    for name in [*own_names(), *(name.split(".")[1] for name, _ in documented() if "." in name)]:
        assert [line for line in headings if re.search(rf"\b{name}\b", line)], name


def test_the_readme_leads_to_the_api_page(root: Path) -> None:
    assert "(docs/api.md)" in (root / "README.md").read_text()


def test_the_script_of_the_readme_runs(arm: gemelo.Arm, root: Path, capsys: pytest.CaptureFixture[str]) -> None:
    [code] = re.findall(r"```python\n(.*?)```", (root / "README.md").read_text(), flags=re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    said = capsys.readouterr().out
    assert "refused (reach)" in said
    assert "nearest that can: position=(0.4" in said
