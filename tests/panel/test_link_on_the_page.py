"""A device that speaks and does not hear, and how old a figure of its link is, on the page."""

from __future__ import annotations

import time
from pathlib import Path

from msgspec.structs import replace

from gemelo.schemas.device import DeviceStatus
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_STATUS
from tests.panel.memory_page import MemoryPage, memory_page
from tests.runtime.support import until


def shows(page: MemoryPage, *wanted: str) -> bool:
    """Draws, and returns True if header and device tab have all of `wanted`."""
    page.draw()
    [shown] = page.panel.pages()
    text = shown.header.content + shown.device.facts.content
    return all(each in text for each in wanted)


def test_the_page_says_for_how_long_a_device_has_not_heard_though_its_states_come(tmp_path: Path) -> None:
    with memory_page("rm1", tmp_path) as page:
        gateway = page.gateway
        page.draw(3)
        assert not shows(page, "does not hear")
        deaf = DeviceStatus(
            online=False,
            speaks=True,
            device="rm1",
            why=because("device.deaf", device="rm1"),
            deaf_since=time.time_ns() - 12 * 10**9,
        )
        gateway.node.publisher(DEVICE_STATUS).put(deaf)
        gateway.round_trip_age = 40.0
        assert until(lambda: shows(page, "speaks and does not hear", "a loose TX wire", " (for 1", "measured 40 s ago"))
        gateway.round_trip_age = 0.0
        well = replace(deaf, online=True, deaf_since=0, why=None, warning="two planners live, a and b")
        gateway.node.publisher(DEVICE_STATUS).put(well)
        assert until(lambda: shows(page, "two planners live, a and b") and not shows(page, "does not hear"))
        assert until(lambda: not shows(page, "measured"))
