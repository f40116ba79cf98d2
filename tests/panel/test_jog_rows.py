"""The arrangement of buttons by the page's script, in a real browser: jog buttons in pairs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser
from playwright.sync_api import Browser

from services.panel.view.browser import CHANNEL, script_html
from tests.panel.person import OPENING, until

LABELS = ("Home", "x +  ▲", "x -  ▼", "z +  PgUp", "z -  PgDn", "a long_joint -", "a long_joint +", "Go + stop")


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    started = viser.ViserServer("127.0.0.1", 0, verbose=False)
    started.gui.add_html(script_html())
    started.gui.add_text(CHANNEL, CHANNEL)
    for label in LABELS:
        started.gui.add_button(label)
    yield started
    started.stop()


def test_the_two_jog_buttons_of_an_axis_share_a_row(server: viser.ViserServer, chromium: Browser) -> None:
    context = chromium.new_context(viewport={"width": 900, "height": 700}, device_scale_factor=0.5)
    page = context.new_page()
    page.goto(f"http://127.0.0.1:{server.get_port()}")
    try:
        page.get_by_role("button", name="Home").wait_for(timeout=OPENING)

        def rows() -> list[float]:
            boxes = [
                page.get_by_role("button", name=label.replace("  ", " "), exact=True).bounding_box() for label in LABELS
            ]
            return [box["y"] if box is not None else -1.0 for box in boxes]

        home, *pairs, stop = until(rows, lambda seen: seen[1] == seen[2])
        assert pairs[0::2] == pairs[1::2]
        assert len({home, *pairs, stop}) == 5
    finally:
        context.close()
