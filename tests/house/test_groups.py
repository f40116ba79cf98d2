"""Tests of one group run in one worker."""

from __future__ import annotations

import pytest

FILES = {
    name: f"""
        import os
        import pytest

        @pytest.mark.parametrize("number", range(4))
        @pytest.mark.xdist_group("pages")
        def test_page(number):
            print("{name} page", os.environ["PYTEST_XDIST_WORKER"])

        @pytest.mark.xdist_group("scripts")
        def test_script():
            print("{name} script", os.environ["PYTEST_XDIST_WORKER"])
    """
    for name in ("test_one", "test_two", "test_three")
}


def test_all_tests_of_a_group_run_in_one_worker(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(**FILES)
    done = pytester.runpytest_subprocess("-n", "2", "--dist", "loadgroup", "-rP", "-p", "tests.stacks.groups")
    done.assert_outcomes(passed=15)
    said = [line.split() for line in done.outlines if line.startswith("test_") and len(line.split()) == 3]
    assert len(said) == 15
    assert len({worker for _, kind, worker in said if kind == "page"}) == 1
    assert len({worker for _, kind, worker in said if kind == "script"}) == 1
