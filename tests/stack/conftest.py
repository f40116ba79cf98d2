"""One stack for all tests of a file, started through process-compose as a user starts it."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.stack.stack import Stack
from tests.optional import need
from tests.stack.person import Operator


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything here needs real processes."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.full)


@pytest.fixture(scope="module")
def stack(tmp_path_factory):
    need("mosquitto")
    with Stack(broker="mosquitto", out=tmp_path_factory.mktemp("out")) as running:
        yield running


@pytest.fixture
def operator(stack):
    stack.wait_ready(20.0)
    person = Operator(stack)
    yield person
    person.close()
