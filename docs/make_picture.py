"""`make picture`: docs/move.gif, one move on the operator's page of a twin of its own, as Chromium draws it.

Sets a goal behind a post, plans, executes, and writes what the page shows, `FASTER` times as fast as it went; no
picture stays long.
"""

from __future__ import annotations

import io
import os
import shutil
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

from PIL import Image, ImageChops
from playwright.sync_api import Page, expect, sync_playwright

import gemelo
from gemelo.tools.stack.stack import Stack

PICTURE = Path(__file__).with_name("move.gif")
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1100, "height": 620}  # [pixels] of the window
SCALE = 0.75  # of a picture's pixels to those of the window
FASTER = 3.0  # than it went: a processor that draws takes some three pictures a second
SPEED = 15  # [%] of the joints' limits
COLOURS = 200
PATIENCE = 120_000.0  # [ms]
FIRST, LONGEST, LAST = 1000, 700, 2500  # [ms] that the first picture, any other and the last stay
SETTLE = 8.0  # [s] until the page is drawn from where it is looked at
CENTRE, FARTHER = (300.0, 300.0), 240.0  # [pixels] of the drawing; of the wheel
POST_SIZE, POST_AT = (0.04, 0.04, 0.16), (0.29, 0.27, 0.08)  # [m]


class Film:
    """Pictures of the page, each with the moment [s] at which it was taken; one that shows nothing new is left out."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self.taken: list[tuple[float, Image.Image]] = []

    def take(self) -> None:
        """One picture."""
        picture = Image.open(io.BytesIO(self._page.screenshot())).convert("RGB")
        if not self.taken or ImageChops.difference(picture, self.taken[-1][1]).getbbox():
            self.taken.append((time.monotonic(), picture))

    def take_until(self, is_over: Callable[[], bool], more: float = 1.0) -> None:
        """Pictures until something is over, and for `more` [s] after that."""
        while not is_over():
            self.take()
        end = time.monotonic() + more
        while time.monotonic() < end:
            self.take()

    def write(self, path: Path) -> None:
        """A GIF whose pictures share one palette."""
        moments = [moment for moment, _ in self.taken]
        stays = [min(round(1000.0 * (after - before) / FASTER), LONGEST) for before, after in pairwise(moments)]
        stays = [FIRST, *stays[1:], LAST]
        palette = self._palette()
        pictures = [each.quantize(palette=palette, dither=Image.Dither.NONE) for _, each in self.taken]
        pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=stays, loop=0, optimize=True)

    def _palette(self) -> Image.Image:
        """With the colours of the first picture, the one in the middle and the last."""
        chosen = [self.taken[place][1] for place in (0, len(self.taken) // 2, -1)]
        width, height = chosen[0].size
        all_of_them = Image.new("RGB", (width, height * len(chosen)))
        for row, picture in enumerate(chosen):
            all_of_them.paste(picture, (0, row * height))
        return all_of_them.quantize(COLOURS, Image.Quantize.MEDIANCUT)


def play(page: Page, arm: gemelo.Arm, film: Film) -> None:
    """What a person does: choose a goal, plan, execute."""

    def button(name: str) -> None:
        page.get_by_role("button", name=name, exact=True).filter(visible=True).click()

    film.take()
    row = page.locator("label").filter(has_text="Named state", visible=True).first.locator("xpath=../../..")
    row.locator("input").first.click()
    page.get_by_role("option", name="left").filter(visible=True).click()
    film.take_until(lambda: len(film.taken) > 4)
    button("Plan")
    film.take_until(page.get_by_text("Duration").filter(visible=True).is_visible, 6.0)
    button("Execute")
    film.take_until(lambda: arm.device.mode is gemelo.DeviceMode.RUN, 0.0)
    film.take_until(lambda: arm.device.mode is gemelo.DeviceMode.IDLE, 2.0)


def main() -> None:
    """Starts the twin and the browser, and writes the picture."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        sys.exit("picture: Chromium draws the page, and is missing: sudo apt-get install chromium")
    with Stack(panel=True) as stack, sync_playwright() as playwright:
        os.environ.update(stack.deployment)  # where the arm is found
        browser = playwright.chromium.launch(executable_path=program, args=FLAGS)
        page = browser.new_page(viewport=SIZE, locale="en-GB", device_scale_factor=SCALE)
        page.set_default_timeout(PATIENCE)
        with gemelo.connect() as arm:
            arm.move(named="home")
            arm.scene.add_box("post", POST_SIZE, POST_AT)
            arm.speed(SPEED / 100.0)
            page.goto(f"http://127.0.0.1:{stack.deployment['GEMELO_PANEL_PORT']}")
            expect(page.locator("[data-gemelo-sent]")).to_be_attached(timeout=PATIENCE)
            film = Film(page)
            page.locator(".mantine-Notification-closeButton").click()  # it says that a processor draws
            page.mouse.move(*CENTRE)
            page.mouse.wheel(0.0, FARTHER)
            film.take_until(page.get_by_role("tab").first.is_visible, SETTLE)
            film.taken.clear()
            play(page, arm, film)
        browser.close()
    film.write(PICTURE)
    print(f"picture: {PICTURE}, {len(film.taken)} pictures, {PICTURE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
