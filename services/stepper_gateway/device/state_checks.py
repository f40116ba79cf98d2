"""Consistency of a device's successive states: those that others send under its name mostly fail it."""

from __future__ import annotations

from gemelo.schemas.device import DeviceMode
from gemelo.services.stepper_gateway.links.frames import BadFrame, StateFrame

MOST_HASTE = 2000  # [us] by which more of the path may be played than time has passed; chosen: a slot, and again
STRANGERS = 3  # states in a row of another boot while the present one is not silent; chosen: no single frame does it
MOVING = (DeviceMode.RUN, DeviceMode.HOLD)


class StateChecks:
    """Checks the states of a device that is not silent."""

    def __init__(self) -> None:
        self._refused: StateFrame | None = None  # that did not follow from the latest
        self._strangers: list[StateFrame] = []  # in a row, of one boot that is not the present one

    def require_steady(self, before: StateFrame | None, state: StateFrame) -> None:
        """Raises `BadFrame` for a state of the present boot whose path is played faster than time, or backwards.

        The one before may have been wrong: then the next one follows from what was refused.
        """
        self._strangers.clear()
        if before is None or state.t_us <= before.t_us:
            return
        objection = _objection(before, state)
        refused, self._refused = self._refused, state if objection else None
        if objection and (refused is None or _objection(refused, state)):
            raise BadFrame(objection)
        self._refused = None

    def require_in_a_row(self, present: StateFrame, state: StateFrame) -> None:
        """Raises `BadFrame` until states of another boot come in a row, with none of the present one between them."""
        if self._strangers and self._strangers[-1].boot_id != state.boot_id:
            self._strangers.clear()
        if not self._strangers or self._strangers[-1].t_us < state.t_us:
            self._strangers.append(state)
        if len(self._strangers) < STRANGERS:
            raise BadFrame(f"a state of boot {state.boot_id}, while boot {present.boot_id} lives")


def _objection(before: StateFrame, state: StateFrame) -> str:
    """Why no device says `state` after `before`; empty if it may."""
    passed = state.t_us - before.t_us
    played = state.play_us - (before.play_us if state.stream == before.stream else 0)
    if passed <= 0:
        return f"a state that is {-passed * 1e-6:.3f} s older than the one before"
    if played > passed + MOST_HASTE:
        return f"a state that has played {played * 1e-6:.3f} s of its stream in {passed * 1e-6:.3f} s"
    if played < 0 and before.mode in MOVING and state.mode in MOVING:
        return f"a state that has played {-played * 1e-6:.3f} s of its stream backwards"
    return ""
