"""The tests that a run left out as something of deploy/optional was missing, and a run of those alone (--left-out)."""

from __future__ import annotations

import pytest

KEY = "gemelo/left_out"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--left-out", action="store_true", help="only what the last run left out as something was missing")


def pytest_configure(config: pytest.Config) -> None:
    """Nothing is kept where nothing may be (-p no:cacheprovider), nor by the workers of pytest-xdist."""
    cache = getattr(config, "cache", None)
    if cache is None:
        return
    if config.getoption("--left-out"):
        config.pluginmanager.register(Chosen(set(cache.get(KEY, []))))
    elif not hasattr(config, "workerinput") and not config.option.collectonly:
        config.pluginmanager.register(Kept(cache))


class Chosen:
    """Leaves of all tests those that were left out."""

    def __init__(self, names: set[str]) -> None:
        self._names = names

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        items[:] = [item for item in items if item.nodeid in self._names]


class Kept:
    """Keeps the names of what is left out."""

    def __init__(self, cache: pytest.Cache) -> None:
        self._cache, self._names = cache, list[str]()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.skipped and "sudo apt-get install" in str(report.longrepr):
            self._names.append(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        self._cache.set(KEY, self._names)
