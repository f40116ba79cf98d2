"""What a run went without as something of deploy/optional was missing, and a run of that alone (--left-out)."""

from __future__ import annotations

import pytest

LEFT_OUT = "gemelo/left_out"
_left_out: list[str] = []


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--left-out", action="store_true", help="only what the last run left out as something was missing")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Chooses the tests of --left-out."""
    if config.getoption("--left-out"):
        chosen = set(_cache(config).get(LEFT_OUT, []))
        items[:] = [item for item in items if item.nodeid in chosen]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped and "sudo apt-get install" in str(report.longrepr):
        _left_out.append(report.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if not config.getoption("--left-out") and not hasattr(config, "workerinput") and not config.option.collectonly:
        _cache(config).set(LEFT_OUT, _left_out)


def _cache(config: pytest.Config) -> pytest.Cache:
    assert config.cache is not None
    return config.cache
