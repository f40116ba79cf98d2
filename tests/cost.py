"""CPU seconds of the tests of each room, processes that they started included: one line after pytest's own summary."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Generator

import pytest

KEY = "cpu_seconds"
spent: Counter[str] = Counter()  # [s], in the process that prints
_before = sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport() -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Adds to each phase's report what the process and its ended children have used since the phase before."""
    global _before
    report = yield
    now = sum(os.times()[:4])
    report.user_properties.append((KEY, now - _before))
    _before = now
    return report


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    spent[room(report.nodeid)] += sum(value for key, value in report.user_properties if key == KEY)


def room(nodeid: str) -> str:
    """The folder of tests/ that a test stands in."""
    return nodeid.split("/")[1] if nodeid.count("/") > 1 else nodeid.partition("::")[0]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    each = ", ".join(f"{name} {seconds:.0f}" for name, seconds in spent.most_common() if seconds >= 0.5)
    terminalreporter.write_line(f"CPU seconds: {sum(spent.values()):.0f}{f' ({each})' if each else ''}")
