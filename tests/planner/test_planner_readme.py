"""The table in services/planner/README.md names every module, and none that is not there."""

from __future__ import annotations

import re
from pathlib import Path

PLANNER = Path(__file__).parents[2] / "services/planner"
ROW = re.compile(r"^\| (?:\*\*.+?\*\*(?:, `\w+/`)?)? ?\| (`.+?`) \| .+ \|$", re.MULTILINE)
OWN = "native"  # has a README of its own


def test_the_table_names_every_module_once():
    cells = ROW.findall((PLANNER / "README.md").read_text(encoding="utf-8"))
    named = [name for cell in cells for name in re.findall(r"`(\w+)`", cell)]
    modules = {path for path in PLANNER.rglob("*.py") if path.stem != "__init__" and OWN not in path.parts}
    assert sorted(named) == sorted(path.stem for path in modules)
