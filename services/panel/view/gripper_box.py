"""The gripper on the page: open, close, an opening, and how it is."""

from __future__ import annotations

from functools import partial

from gemelo.schemas.grippers.kinds import Gripper
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.kit import Kit, note, set_if_new

MILLIMETRES = 1000.0


class GripperBox:
    """Of an arm with a gripper; what its buttons close on is attached in the scene."""

    def __init__(self, kit: Kit, gripper: Gripper) -> None:
        self._kit = kit
        words, arm = kit.words, kit.operator.arm
        with kit.gui.add_folder(words("gripper")):
            self._status = kit.line()
            for key, to in (("grip_open", "open"), ("grip_close", "close")):
                kit.button(words(key), partial(arm.grip, to), color="blue", needs="grip")
            self._opening = kit.gui.add_slider(
                words("grip_opening"), gripper.closed * MILLIMETRES, gripper.open * MILLIMETRES, 1.0,
                gripper.open * MILLIMETRES,
            )  # fmt: skip
            kit.button(words("grip_go"), self._go, color="gray", needs="grip")
            kit.reasons(grip=words("gripper"))

    def refresh(self, readings: Readings) -> None:
        """The opening, and whether it presses."""
        words, state = self._kit.words, readings.gripper
        if state is None:
            return
        told = [f"{state.position * MILLIMETRES:.1f} mm"] if state.known else [words("grip_not_known")]
        if state.known and not state.measured:
            told.append(words("grip_commanded"))
        if state.effort:
            told.append(words("grip_presses", effort=f"{state.effort:g}"))
        set_if_new(self._status, "content", note(", ".join(told)))

    def _go(self) -> None:
        self._kit.operator.arm.grip(float(self._opening.value) / MILLIMETRES)
