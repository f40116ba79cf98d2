"""The table in firmware/tests/README.md names tests that exist."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TABLE = ROOT / "firmware" / "tests" / "README.md"
GOOGLE_TEST = re.compile(r"^TEST(?:_[FP])?\((\w+),\s*(\w+)\)", re.MULTILINE)
PYTEST = re.compile(r"^(?:async )?def (test_\w+)", re.MULTILINE)
ROW = re.compile(r"^\| (?!rule )([^|]+) \| ([^|]+) \|$", re.MULTILINE)


def rows() -> list[tuple[str, list[str]]]:
    """Each rule and the tests that its row names."""
    return [(rule, re.findall(r"`([^`]+)`", tests)) for rule, tests in ROW.findall(TABLE.read_text())]


def existing() -> set[str]:
    """Every test of the firmware's GoogleTest suite and of pytest, by name."""
    sources = (path.read_text() for path in (ROOT / "firmware" / "tests").glob("*_test.cpp"))
    google = {f"{suite}.{name}" for text in sources for suite, name in GOOGLE_TEST.findall(text)}
    return google | {name for path in (ROOT / "tests").rglob("test_*.py") for name in PYTEST.findall(path.read_text())}


def test_every_rule_names_a_test() -> None:
    assert len(rows()) >= 25
    assert [rule for rule, tests in rows() if not tests] == []


def test_every_named_test_exists() -> None:
    there = existing()
    assert [name for _, tests in rows() for name in tests if name not in there] == []
