"""Clicks into a camera's image in a real browser, as the page's script tells them; no stack is needed for it."""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterator
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import viser
from playwright.sync_api import Browser, Page, expect

from gemelo.schemas.camera import CameraImage
from gemelo.services.panel.view.browser import CHANNEL, read_browser, script_html
from tests.panel.person import OPENING, PATIENCE, place_in_image, until
from tests.panel.test_camera_box import opened
from tests.stacks.browser import new_context

JPEG = cv2.imencode(".jpg", np.full((480, 640, 3), 90, np.uint8))[1].tobytes()


@pytest.fixture(scope="module")
def server() -> Iterator[viser.ViserServer]:
    started = viser.ViserServer("127.0.0.1", 0, verbose=False)
    yield started
    started.stop()


@pytest.fixture
def shown(server: viser.ViserServer, chromium: Browser) -> Iterator[SimpleNamespace]:
    """The cameras' part of the page in a browser, and what comes of it."""
    page = opened(server, ("bin",))
    server.gui.add_html(script_html())
    channel = server.gui.add_text(CHANNEL, CHANNEL)

    @channel.on_update
    def _(event: viser.GuiEvent) -> None:
        told = read_browser(event.target.value)
        if told is not None and told.clicked is not None:
            page.told.append(told.clicked)

    page.told = []
    page.stamp = 0
    context = new_context(chromium, viewport={"width": 900, "height": 900}, device_scale_factor=0.5)
    browser = context.new_page()
    browser.goto(f"http://127.0.0.1:{server.get_port()}")
    show(page)
    expect(image(browser)).to_be_visible(timeout=OPENING)
    page.browser = browser
    yield page
    context.close()


def show(page: SimpleNamespace) -> None:
    """A new image of each camera, which takes the place of the one before."""
    page.stamp += 1
    for name in ("above", "side"):
        message = CameraImage(stamp=page.stamp, camera=name, width=640, height=480, data=JPEG + b"%d" % page.stamp)
        page.handlers[f"camera/{name}/image"](message)
    page.box.refresh()


def image(browser: Page, camera: str = "above"):
    return browser.locator(f"img[data-gemelo-camera={camera}]")


def at(browser: Page, x: float, y: float, camera: str = "above") -> tuple[float, float]:
    """[pixels] of the page, of a pixel of the camera."""
    return place_in_image(browser, camera, x / 640.0, y / 480.0)


def source(browser: Page) -> bytes:
    return b64decode((image(browser).get_attribute("src") or "").partition(",")[2])


def test_a_click_is_told_in_shares_of_the_image_also_where_the_next_image_comes_between(shown) -> None:
    mouse = shown.browser.mouse
    mouse.move(*at(shown.browser, 310.0, 190.0))
    mouse.down()
    before = source(shown.browser)
    show(shown)
    until(lambda: source(shown.browser), lambda now: now != before)
    mouse.up()
    (click,) = until(lambda: list(shown.told), bool)
    assert (click.camera, click.number) == ("above", 1)
    assert (640.0 * click.x, 480.0 * click.y) == (pytest.approx(310.0, abs=2.0), pytest.approx(190.0, abs=2.0))
    shown.box.point(click)
    shown.box.refresh()
    assert shown.picks.thing == "bolt"
    expect(shown.browser.get_by_text("bolt is chosen.")).to_be_visible(timeout=PATIENCE)


def test_a_drag_and_a_click_beside_the_images_are_none_and_the_other_camera_is_named(shown) -> None:
    mouse = shown.browser.mouse
    x, y = at(shown.browser, 310.0, 190.0)
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 40.0, y)
    mouse.up()
    mouse.click(100.0, 100.0)
    mouse.click(*at(shown.browser, 100.0, 100.0, "side"))
    (click,) = until(lambda: list(shown.told), bool)
    assert (click.camera, click.number) == ("side", 1)
