"""A test that was left out as a program is missing runs by --left-out alone, once it is there."""

from __future__ import annotations

import pytest

TESTS = """
import os, pytest

def test_needs_a_program():
    if "HERE" not in os.environ:
        pytest.skip("Vulkan missing: sudo apt-get install mesa-vulkan-drivers")

def test_needs_another_thing():
    pytest.skip("not on this machine")

def test_needs_nothing(): ...
"""


def test_what_was_left_out_is_run_alone(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    pytester.makepyfile(TESTS)
    with_plugin = ("-p", "tests.left_out")
    pytester.inline_run(*with_plugin).assertoutcome(passed=1, skipped=2)
    monkeypatch.setenv("HERE", "yes")
    pytester.inline_run(*with_plugin, "--left-out").assertoutcome(passed=1)
    pytester.inline_run(*with_plugin, "-p", "no:cacheprovider").assertoutcome(passed=2, skipped=1)
