"""Every test is run by `make test` or by the rest of `make test-all`, once, and nothing is run again."""

from __future__ import annotations

import ast
import os
import re
import subprocess
from itertools import product
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FROM_MAKE = ("ROOM", "MAKEFLAGS", "MAKEOVERRIDES", "MFLAGS")  # what `make test ROOM=house` leaves to what it starts


def runs(target: str) -> list[str]:
    """The marker expressions of the runs of pytest that a target of the Makefile makes."""
    command = ["make", "-n", "--no-print-directory", target]
    of_its_own = {name: value for name, value in os.environ.items() if name not in FROM_MAKE}
    ran = subprocess.run(command, cwd=ROOT, env=of_its_own, capture_output=True, text=True, timeout=60.0, check=True)
    recipe = ran.stdout
    calls = [line for line in recipe.splitlines() if "bin/pytest " in line]
    assert not [line for line in calls if "--last-failed" in line or "--lf" in line or "rerun" in line]
    return [re.findall(r'-m "([^"]+)" tests/?$', line)[0] for line in calls]


def is_chosen(expression: str, marks: dict[str, bool]) -> bool:
    return bool(eval(expression, {"__builtins__": {}}, marks))


def test_every_test_is_run_once_and_every_property_once_more_with_all_its_examples():
    [quick], [properties, *slow] = runs("test"), runs("test-rest")
    for full, alone, hypothesis, scaled in product((False, True), repeat=4):
        if alone and not full:
            continue  # tests/conftest.py marks what is alone as full
        marks = {"full": full, "alone": alone, "hypothesis": hypothesis, "scaled": scaled}
        assert sum(is_chosen(each, marks) for each in (quick, *slow)) == 1, marks
        assert is_chosen(properties, marks) is ((hypothesis or scaled) and not full), marks


def test_all_is_what_is_quick_and_then_the_rest():
    assert runs("test-all") == runs("test") + runs("test-rest")


def test_one_room_is_run_by_its_name():
    command = ["make", "-n", "test", "ROOM=planner"]
    recipe = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60.0, check=True).stdout
    [call] = [line for line in recipe.splitlines() if "bin/pytest " in line]
    assert call.endswith('-m "not full" tests/planner')
    assert "deploy/test_firmware" not in recipe


def test_what_counts_its_cases_by_the_profile_is_marked_so_that_all_of_them_are_run():
    """As pytest knows of a property only where the test itself is one."""
    unmarked = [
        f"{path.name}::{test.name}"
        for path in sorted((ROOT / "tests").rglob("test_*.py"))
        for test in ast.parse(path.read_text()).body
        if isinstance(test, ast.FunctionDef) and test.name.startswith("test_")
        and re.search(r"\b(count\(quick=|given\()", "\n".join(map(ast.unparse, test.body)))
        and not {"pytest.mark.scaled", "pytest.mark.full"} & set(map(ast.unparse, test.decorator_list))
    ]  # fmt: skip
    assert unmarked == []


def test_no_property_sets_the_number_of_its_examples_by_itself():
    files = [path for path in (ROOT / "tests").rglob("test_*.py") if "max_examples=" in path.read_text()]
    assert [path.name for path in files] == [Path(__file__).name]


def test_pytest_finds_every_file_with_tests():
    files = [
        path for path in (ROOT / "tests").rglob("*.py") if re.search(r"^def test_", path.read_text(), re.MULTILINE)
    ]
    assert len(files) > 300
    assert [str(path) for path in files if not path.name.startswith("test_")] == []


def test_what_starts_a_stack_or_a_browser_or_runs_alone_is_full(pytester: pytest.Pytester):
    pytester.makeconftest((ROOT / "tests/conftest.py").read_text().replace("pytest_plugins", "plugins"))
    pytester.makeini("[pytest]\nmarkers =\n    full\n    alone\n")
    pytester.makepyfile(
        """
        import pytest

        @pytest.fixture
        def twin(): ...

        @pytest.fixture
        def arm(twin): ...

        @pytest.mark.alone
        def test_alone(): ...

        def test_on_a_stack(arm): ...

        def test_quick(): ...
        """
    )
    pytester.inline_run("-m", "not full").assertoutcome(passed=1)
    pytester.inline_run("-m", "full").assertoutcome(passed=2)
