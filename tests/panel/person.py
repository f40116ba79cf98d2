"""A person at the page: reads labels, presses buttons and keys, types numbers, drags what is drawn."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TypeVar

import imageio.v3 as imageio
import numpy as np
from playwright.sync_api import Browser, Locator, Page, ViewportSize, expect

from tests.stacks.browser import PATIENCE, new_context

T = TypeVar("T")

OPENING = 300_000.0  # [ms] and compiles its shaders in a minute or more
SCALE = 0.5  # of a picture's pixels to those of the page: a processor draws a quarter of them
CONTROLS = 450  # [pixels] of the page
STILL = 2.5  # [s] the drawing of a loaded machine lags so much
CHANGED = 30  # of 255: what differs more between two pictures was drawn anew
# At most ten pictures a second: a processor that draws does little else, and the tests wait for what it shows.
CALM = """
  window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 100);
  window.cancelAnimationFrame = (number) => clearTimeout(number);
"""
BLUE = (45, 140, 255)  # of the gizmo's arrow along z


class Person:
    """One browser window."""

    def __init__(self, browser: Browser, port: str, language: str, size: ViewportSize) -> None:
        self._context = new_context(browser, viewport=size, locale=language, device_scale_factor=SCALE)
        self._drawing = int(
            SCALE * (size["width"] - CONTROLS)
        )  # [pixels] of the picture that are drawn in three dimensions
        self._address = f"http://127.0.0.1:{port}"
        self._context.add_init_script(CALM)
        self.page = self._context.new_page()
        self._errors: list[str] = []
        self.page.on("pageerror", lambda error: self._errors.append(str(error)))

    def __enter__(self) -> Person:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._context.close()

    def open(self) -> None:
        """Until the state is live and drawn."""
        self.page.goto(self._address, timeout=OPENING)
        expect(self.page.locator("[data-gemelo-sent]")).to_be_attached(timeout=OPENING)
        expect(self.page.get_by_role("tab").first).to_be_visible(timeout=PATIENCE)

    def tab(self, name: str) -> None:
        self.page.get_by_role("tab", name=name, exact=True).click()

    def press(self, name: str) -> None:
        self.button(name).click()

    def button(self, name: str) -> Locator:
        return self.page.get_by_role("button", name=name, exact=True).filter(visible=True)

    def reads(self, text: str) -> None:
        """Waits until the page says so."""
        expect(self.page.get_by_text(text).filter(visible=True).first).to_be_visible(timeout=PATIENCE)

    def types(self, label: str, value: object) -> None:
        field = self.field(label)
        field.fill(str(value))
        field.press("Enter")

    def fills(self, label: str, numbers: Sequence[float]) -> None:
        """The fields of one row, from the left."""
        for place, number in enumerate(numbers):
            field = self.row(label).locator("input").filter(visible=True).nth(place)
            field.fill(str(number))
            field.press("Enter")

    def values(self, label: str) -> list[float]:
        """Of the fields of one row, from the left."""
        fields = self.row(label).locator("input").filter(visible=True)
        return [float(field.input_value()) for field in fields.all()]

    def chooses(self, label: str, option: str) -> None:
        self.row(label).locator("input").first.click()
        self.page.get_by_role("option", name=option).filter(visible=True).click()

    def ticks(self, label: str) -> None:
        self.row(label).locator("input[type=checkbox]").click()

    def field(self, label: str) -> Locator:
        return self.row(label).locator("input, textarea").filter(visible=True).last

    def value(self, label: str) -> float:
        return float(self.field(label).input_value())

    def row(self, label: str) -> Locator:
        return self.page.locator("label").filter(has_text=label, visible=True).first.locator("xpath=../../..")

    def picture(self) -> np.ndarray:
        """(height, width, 3) what the person sees."""
        return np.asarray(imageio.imread(io.BytesIO(self.page.screenshot())))[:, :, :3]

    def drags_down_arrow(self, color: tuple[int, int, int], right: float, down: float) -> None:
        """Takes the gizmo's arrow of that colour, which points down, by its head and leads it so many pixels."""
        self.drags(self._tip_of(color), right, down)

    def drags(self, start: tuple[float, float], right: float, down: float) -> None:
        """Takes what is drawn at `start` [pixels] of the page and leads it so many pixels."""
        x, y = start
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        for part in range(1, 9):
            self.page.mouse.move(x + right * part / 8, y + down * part / 8)
        self.page.mouse.up()

    def still_picture(self) -> np.ndarray:
        """What the person sees once nothing has moved in the drawing for `STILL`."""
        seen, since = self.picture(), time.monotonic()

        def look() -> bool:
            nonlocal seen, since
            before = seen
            seen = self.picture()
            if self.differs(before, seen).any():
                since = time.monotonic()
            return time.monotonic() > since + STILL

        until(look, bool)
        return seen

    def drawn_since(self, before: np.ndarray, color: tuple[int, int, int] | None = None) -> np.ndarray:
        """(n, 2) [pixels] of the page: rightwards and downwards, of what is drawn otherwise than in the picture
        `before`, once it stands still; of what has this colour alone, where one is given."""

        def found() -> np.ndarray:
            now = self.still_picture()
            changed = self.differs(before, now)
            if color is not None:  # thin lines are blended with what is behind
                changed &= np.abs(now.astype(int)[:, : self._drawing] - color).max(axis=2) < 60
            return np.argwhere(changed)

        return until(found, lambda seen: len(seen) > 5)[:, ::-1] / SCALE

    def differs(self, before: np.ndarray, now: np.ndarray | None = None) -> np.ndarray:
        """(height, width) where the drawing is another one than in `before`: in `now`, or as it is seen."""
        now = self.picture() if now is None else now
        return np.abs(now.astype(int) - before)[:, : self._drawing].max(axis=2) > CHANGED

    def require_no_errors(self) -> None:
        assert self._errors == []

    def _tip_of(self, color: tuple[int, int, int]) -> tuple[float, float]:
        """Within the lowest of all that has this colour in the drawing: the head of the arrow that points down."""

        def found() -> np.ndarray:
            apart = np.abs(self.picture().astype(int)[:, : self._drawing] - color).max(axis=2)
            return np.argwhere(apart < 30)

        pixels = until(found, lambda seen: len(seen) > 10)
        row, column = pixels[pixels[:, 0] == pixels[:, 0].max()].mean(axis=0)
        return float(column) / SCALE, float(row) / SCALE - 5.0


def place_in_image(page: Page, camera: str, x: float, y: float) -> tuple[float, float]:
    """[pixels] of the page, of a place in a camera's image from 0 to 1, once the image stands still; the image is
    replaced all the time, so its element is looked for each time."""
    found = page.evaluate(
        """async (camera) => {
          const place = () => {
            const image = document.querySelector(`img[data-gemelo-camera="${camera}"]`);
            image.scrollIntoView({block: 'center', behavior: 'instant'});
            const box = image.getBoundingClientRect();
            return [box.left, box.top, box.width, box.height];
          };
          let last = place(), still = 0;
          while (still < 10) {
            await new Promise(requestAnimationFrame);
            const next = place();
            still = String(next) === String(last) ? still + 1 : 0;
            last = next;
          }
          return last;
        }""",
        camera,
    )
    left, top, width, height = found
    return left + x * width, top + y * height


def until(
    look: Callable[[], T],
    is_so: Callable[[T], bool],
    patience: float = PATIENCE / 1000.0,
    said: Callable[[], object] = str,
) -> T:
    """What `look` gives once it is so; AssertionError after `patience` [s], with what `said` gives, as the page's."""
    end = time.monotonic() + patience
    while not is_so(seen := look()):
        assert time.monotonic() < end, f"still {seen}; {said()}"
        time.sleep(0.01)
    return seen
