"""The Spanish page of the first hour, walked as the English one, on a twin that nobody has used yet."""

from __future__ import annotations

from playwright.sync_api import Browser

from gemelo.tools.stack.stack import Stack
from tests.panel.test_first_hour import walk


def test_the_first_hour_goes_as_it_is_told_in_spanish(twin: Stack, chromium: Browser) -> None:
    walk("es", twin, chromium)
