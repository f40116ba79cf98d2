"""Buttons, numbers and lines of text for one browser, in its language, each action with its errors told."""

from __future__ import annotations

import html
from collections.abc import Callable, Coroutine, Sequence
from typing import Literal

import viser

from gemelo.services.panel.model.availability import Reason
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.problems import reporting
from gemelo.services.panel.words.words import Words

OWN_CHANGE = 0.6  # [s] after its own change a browser's inputs are not written: the next one may be under way
Color = Literal["red", "blue", "green", "gray", "orange", "yellow", "teal"]


class Kit:
    """What every tab builds itself of. Buttons that `needs` name are greyed while it cannot be done."""

    def __init__(self, client: viser.ClientHandle, operator: Operator, words: Words) -> None:
        self.client, self.gui, self.operator, self.words = client, client.gui, operator, words
        self.gated: list[tuple[viser.GuiButtonHandle, str]] = []
        self.reason_places: list[tuple[viser.GuiHtmlHandle, dict[str, str]]] = []

    def button(
        self,
        label: str,
        action: Callable[[], object],
        *,
        color: Color | None = None,
        needs: str = "",
        first: Callable[[], object] | None = None,
    ) -> viser.GuiButtonHandle:
        """`action` runs in a thread of its own; once it is done, the refusal of the press before is shown no more.

        `first` runs before it, in the order in which a browser's buttons are pressed; it must not wait.
        """
        handle = self.gui.add_button(label, color=color)
        if first is not None:
            handle.on_click(at_once(first))

        def act() -> None:
            told = self.operator.newest_problem
            action()
            self.operator.mended(told)

        handle.on_click(without_event(reporting(self.operator.tell, act)))
        if needs:
            self.gated.append((handle, needs))
        return handle

    def urgent(self, label: str, action: Callable[[], object], *, color: Color) -> viser.GuiButtonHandle:
        """`action` runs where the browser's words are read, before all that other buttons do; it must not wait."""
        handle = self.gui.add_button(label, color=color)
        handle.on_click(at_once(action))
        return handle

    def held(self, label: str, action: Callable[[], object], *, rate: float, needs: str = "") -> viser.GuiButtonHandle:
        """`action` is called `rate` [1/s] times while the button is held."""
        handle = self.gui.add_button(label, color="gray")
        handle.on_hold(without_event(action), callback_hz=rate)
        if needs:
            self.gated.append((handle, needs))
        return handle

    def reasons(self, **titles: str) -> None:
        """A place for the reasons why actions cannot be done now: by action, what it is called."""
        self.reason_places.append((self.gui.add_html(""), titles))

    def line(self, content: str = "") -> viser.GuiHtmlHandle:
        """A piece of HTML."""
        return self.gui.add_html(content)

    def refresh(self, reasons: dict[str, Reason]) -> None:
        """Greys what cannot be done now, and says why."""
        for button, name in self.gated:
            set_if_new(button, "disabled", reasons.get(name) is not None)
        for place, titles in self.reason_places:
            told: dict[str, list[str]] = {}
            for name, title in titles.items():
                why = self.words.reason(reasons.get(name))
                if why:
                    told.setdefault(why, []).append(title)
            lines = (f"{esc(', '.join(of))}: {esc(why)}<br>" for why, of in told.items())
            set_if_new(place, "content", note("".join(lines)))


def without_event(action: Callable[[], object]) -> Callable[[object], None]:
    """A callback of viser's that needs to know nothing of the event."""

    def run(event: object) -> None:
        action()

    return run


def at_once(action: Callable[[], object]) -> Callable[[object], Coroutine[object, object, None]]:
    """As `without_event`, but not in one of viser's threads, which may all be busy; `action` must not wait."""

    async def run(event: object) -> None:
        action()

    return run


class Mirror:
    """Shows in an input what the twin says, only when that changes: what a person has just set stays until then."""

    def __init__(self, handle: object) -> None:
        self.handle, self._shown = handle, object()

    def show(self, value: object) -> None:
        """The newest of what the twin says."""
        if value != self._shown:
            self._shown = value
            set_if_new(self.handle, "value", value)


class Steady:
    """A measured value of which only a real change is shown: else the page would be sent again for its noise."""

    def __init__(self, share: float, least: float) -> None:
        """A change counts from `share` of the value that is shown, and from `least` in its own unit."""
        self._share, self._least = share, least
        self._shown: float | None = None

    def of(self, value: float) -> float:
        """What to show, in the unit of `value`, now that this is measured."""
        if self._shown is None or abs(value - self._shown) > max(self._least, self._share * abs(self._shown)):
            self._shown = value
        return self._shown


def set_if_new(handle: object, name: str, value: object) -> None:
    """Sends nothing where it is so already."""
    if getattr(handle, name) != value:
        setattr(handle, name, value)


def esc(text: object) -> str:
    """Text that a person or a file has written, safe in HTML."""
    return html.escape(str(text), quote=True)


def note(content: str) -> str:
    """Small print; nothing at all where there is nothing to say."""
    return f'<div style="margin:0 0.9em 0.5em;font-size:0.8em;opacity:0.75">{content}</div>' if content else ""


def box(content: str, color: str) -> str:
    """A coloured box that stands out, on light and on dark; a line of the content is a line of the box."""
    return (
        f'<div style="margin:0 0.8em 0.5em;padding:0.45em 0.7em;border-left:4px solid {color};border-radius:4px;'
        f'background:{color}22;font-size:0.85em;line-height:1.35;white-space:pre-line">{content}</div>'
    )


def table(rows: Sequence[tuple[str, ...]], header: tuple[str, ...] = ()) -> str:
    """Cells are HTML; the first column is left, the others right."""
    cells = [_row(header, "th")] if header else []
    cells += [_row(row, "td") for row in rows]
    return (
        '<table style="margin:0 0.8em 0.6em;font-size:0.82em;width:calc(100% - 1.6em);border-collapse:collapse;'
        f'font-variant-numeric:tabular-nums">{"".join(cells)}</table>'
    )


def _row(cells: tuple[str, ...], tag: str) -> str:
    style = "padding:1px 2px;font-weight:normal;text-align:"
    first, *others = cells
    rest = "".join(f'<{tag} style="{style}right">{cell}</{tag}>' for cell in others)
    return f'<tr style="border-bottom:1px solid #8884"><{tag} style="{style}left">{first}</{tag}>{rest}</tr>'
