"""The table of CONTRIBUTING.md: each promise is shown by files that are there, in the lane that it names."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WHOLE = {"twin", "chromium"}  # as tests/conftest.py marks by them


def rows(file: str, heading: str) -> Iterator[list[str]]:
    """The cells of the table's rows that begins with `heading`."""
    table = (ROOT / file).read_text(encoding="utf-8").partition(f"\n{heading}")[2].partition("\n\n")[0]
    for line in table.splitlines()[2:]:
        yield [cell.strip() for cell in line.strip("|").split("|")]


PROMISES = [(name, *(re.findall(r"`([\w/]+\.py)`", cell) for cell in cells))
            for name, *cells in rows("CONTRIBUTING.md", "| promise |")]  # fmt: skip


def test_every_row_of_what_may_die_and_of_who_may_do_what_is_a_promise_of_the_table() -> None:
    wanted = {f"when it dies: {row[0]}" for row in rows("docs/inside/failures.md", "| what | what the arm does |")}
    wanted |= {f"may do no more: {row[0]}" for row in rows("SECURITY.md", "| who | may do what |")}
    assert len(wanted) > 20
    assert {name for name, *_ in PROMISES if not name.startswith(("README: ", "docs: "))} == wanted


def test_every_promise_is_shown_by_a_file() -> None:
    assert [name for name, quick, full in PROMISES if not quick and not full] == []


def functions(path: Path) -> list[ast.FunctionDef]:
    return [each for each in ast.parse(path.read_text()).body if isinstance(each, ast.FunctionDef)]


def is_marked(node: ast.AST) -> bool:
    return re.search(r"pytest\.mark\.(full|alone)\b", ast.unparse(node)) is not None


def lanes(file: str) -> set[bool]:
    """Whether some tests of a file are full, and some not: by its mark, theirs, or the fixtures that they ask for."""
    path = ROOT / "tests" / file
    body = ast.parse(path.read_text()).body
    if any(isinstance(each, ast.Assign) and is_marked(each) for each in body) or path.parent.name == "stack":
        return {True}
    near = [*(ROOT / "tests/stacks").glob("*.py"), *path.parent.glob("conftest.py"), path]
    asks = {each.name: {argument.arg for argument in each.args.args} for one in near for each in functions(one)}

    def needs(name: str, seen: frozenset[str] = frozenset()) -> bool:
        return name in WHOLE or any(needs(other, seen | {name}) for other in asks.get(name, set()) - seen - {name})

    tests = [each for each in functions(path) if each.name.startswith("test_")]
    return {any(map(is_marked, test.decorator_list)) or needs(test.name) for test in tests}


def test_every_file_of_the_table_has_tests_in_the_lane_that_it_stands_under() -> None:
    files = {file for _, quick, full in PROMISES for file in (*quick, *full)}
    assert [file for file in sorted(files) if not (ROOT / "tests" / file).is_file()] == []
    wanted = {(file, False) for _, quick, _ in PROMISES for file in quick}
    wanted |= {(file, True) for _, _, full in PROMISES for file in full}
    assert wanted - {(file, lane) for file in files for lane in lanes(file)} == set()


@pytest.mark.parametrize("name", ["README: ", "docs: ", "when it dies: ", "may do no more: "])
def test_each_kind_of_promise_is_there(name: str) -> None:
    assert any(promise.startswith(name) for promise, *_ in PROMISES)
