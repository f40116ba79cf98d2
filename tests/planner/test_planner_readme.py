"""The table in services/planner/README.md names every module, and none that is not there."""

from __future__ import annotations

import re
from pathlib import Path

PLANNER = Path(__file__).parents[2] / "services/planner"
ROW = re.compile(r"^\| (?:\*\*.+?\*\*)? ?\| (`.+?`) \| .+ \|$", re.MULTILINE)


def test_the_table_names_every_module_once():
    cells = ROW.findall((PLANNER / "README.md").read_text(encoding="utf-8"))
    named = [name for cell in cells for name in re.findall(r"`(\w+/?)`", cell)]
    modules = {path.stem for path in PLANNER.glob("*.py")} - {"__init__"}
    assert sorted(named) == sorted({*modules, "native/"})
