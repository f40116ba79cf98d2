"""One worker for the tests of a group, with `--dist loadgroup`: what shares a stack, or draws pages, or is of one file.

pytest-xdist 3.8 hands a test's group over in an attribute that pytest 9.2 no longer reads: without this file it groups
nothing, so that each worker starts every shared stack and a browser of its own.
"""

from __future__ import annotations

import pytest
from _pytest.nodeid import NodeId


@pytest.hookimpl(trylast=True)  # after all groups are given
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """In a worker: the name of each test ends with that of its group."""
    if not getattr(config.option, "loadgroup", False):
        return
    for item in items:
        mark = item.get_closest_marker("xdist_group")
        if mark is not None and not item.nodeid.endswith(f"@{mark.args[0]}"):
            item._id = NodeId.parse(f"{item.nodeid}@{mark.args[0]}")
