"""The shared stack of rm1, started through process-compose as a user starts it, and a person at the command."""

from __future__ import annotations

from pathlib import Path

import pytest

import gemelo
from tests.stack.person import Operator
from tests.stacks.shared import found_by_scripts


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Everything here needs real processes."""
    for item in items:
        if Path(__file__).parent in item.path.parents:
            item.add_marker(pytest.mark.full)


@pytest.fixture(scope="module")
def stack(rm1_stack):
    return rm1_stack


@pytest.fixture
def operator(stack):
    stack.wait_ready(120.0)
    person = Operator(stack)
    yield person
    person.close()


@pytest.fixture(scope="module")
def twin(rm1_stack):
    """The same; what connects in this process or in one that it starts finds it."""
    with found_by_scripts(rm1_stack):
        yield rm1_stack


@pytest.fixture
def arm(twin):
    """At home, as a script has it."""
    with gemelo.connect(timeout=60.0) as connected:
        yield connected
