"""Seeing and picking on the page: the things and places of the cell, what was seen, and one pick at a time."""

from __future__ import annotations

import threading
from collections.abc import Callable

import gemelo
from gemelo.libraries.arm.cell.cell_file import Cell
from gemelo.schemas.reasons import Reason
from gemelo.services.panel.model.problems import Problem


class Picks:
    """One for all browsers; `look` and `pick` return when they are done, and raise what `gemelo` raises."""

    def __init__(
        self, arm: gemelo.Arm, cell: Cell, tell: Callable[[Problem], object], wake: Callable[[], None]
    ) -> None:
        self._arm, self._tell, self._wake = arm, tell, wake
        self.things = tuple(each.name for each in cell.things)
        self.places = tuple(each.name for each in cell.places)
        self._one = threading.Lock()
        self._stops = 0
        self.lines: tuple[Reason, ...] = ()  # what was seen, or what the pick is at

    def look(self) -> None:
        """What the cameras see."""
        self._alone(self._look)

    def pick(self, thing: str, place: str) -> None:
        """Takes the thing to the place; a Stop meanwhile ends it."""
        self._alone(lambda: self._pick(thing, place))

    def on_stop(self) -> None:
        """What is being picked is not carried on."""
        self._stops += 1

    def _look(self) -> None:
        self._show(*(each.summary for each in self._arm.detect()))

    def _pick(self, thing: str, place: str) -> None:
        stops = self._stops
        self._show()

        def follow(part: Reason) -> None:
            self._show(*self.lines, part)

        picked = self._arm.pick(thing, to=place, on_progress=follow, is_cancelled=lambda: stops != self._stops)
        self._show(picked.summary)

    def _alone(self, action: Callable[[], None]) -> None:
        if not self._one.acquire(blocking=False):
            self._tell(Problem("busy", "busy"))
            return
        try:
            action()
        finally:
            self._one.release()

    def _show(self, *lines: Reason) -> None:
        self.lines = lines
        self._wake()
