"""The box of control: the holder, and buttons to take it and to give it back; the page holds it for all browsers."""

from __future__ import annotations

from gemelo.services.panel.model.availability import other_holder
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.kit import Kit, box, esc, note, set_if_new

MINE, OTHER = "#1c7ed6", "#f08c00"


class ControlBox:
    """One line, and the one or two buttons that mean something now."""

    def __init__(self, kit: Kit) -> None:
        self._words, self._operator = kit.words, kit.operator
        operator: Operator = kit.operator
        self._line = kit.line()
        self._take = kit.button(kit.words("take_control"), operator.take_control, color="gray")
        self._force = kit.button(kit.words("force_control"), lambda: operator.take_control(force=True), color="orange")
        self._give = kit.button(kit.words("give_control"), operator.give_control, color="blue")

    def refresh(self, readings: Readings) -> None:
        """Shows the newest that the gateway has said."""
        control, arm = readings.control, self._operator.arm
        is_held = control is not None and control.held
        other = other_holder(arm, readings)
        set_if_new(self._take, "visible", control is not None and not is_held)
        set_if_new(self._force, "visible", other is not None)
        set_if_new(self._give, "visible", is_held and other is None)
        set_if_new(self._line, "content", self._text(readings, other))

    def _text(self, readings: Readings, other: str | None) -> str:
        words, control = self._words, readings.control
        if control is None or not control.held:
            return note(esc(words("control_nobody"))) if control is not None else ""
        if other is None:
            return box(esc(words("control_mine")), MINE)
        text = words("control_other", name=other, node=control.node, host=control.host)
        return box(f"<b>{esc(text)}</b>", OTHER)
