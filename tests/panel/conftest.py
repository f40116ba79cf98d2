"""The shared stack with the page, the arm as a script has it, and a person at the page."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser

import gemelo
from gemelo.tools.stack.stack import Stack
from tests.panel.person import Person
from tests.panel.served import Served, served_page
from tests.simulated import make_ready
from tests.stacks.browser import SIZE
from tests.stacks.shared import found_by_scripts


@pytest.fixture(scope="module")
def twin(panel_stack: Stack) -> Iterator[Stack]:
    """The shared stack with the page; what connects in this process or in one that it starts finds it."""
    with found_by_scripts(panel_stack):
        yield panel_stack


@pytest.fixture
def arm(twin: Stack) -> Iterator[gemelo.Arm]:
    """Referenced, armed, at rest in "home", at full speed, with an empty scene."""
    twin.wait_ready(120.0)
    with gemelo.connect(timeout=60.0) as connected:
        make_ready(connected)
        connected.move(named="home")
        yield connected


@pytest.fixture(scope="module")
def served(twin: Stack) -> Iterator[Served]:
    """The page in this process, where a file's `twin` has none."""
    twin.wait_ready(120.0)
    with served_page() as served:
        yield served


@pytest.fixture
def person(twin: Stack, arm: gemelo.Arm, chromium: Browser) -> Iterator[Person]:
    """Somebody who reads English, and has just opened the page."""
    with Person(chromium, twin.deployment["GEMELO_PANEL_PORT"], "en-US", SIZE) as opened:
        yield opened
        opened.require_no_errors()
