"""Choice of the device's states that are published: all while anything changes, few while the arm rests."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.motion.path_version import PathPoint

SHORTEST = 1.0 / (JOINT_STATES.rate or 50.0)  # [s] between two states in motion


class StateThinner:
    """A state that differs from the one before passes at once; between equal ones the gap at most doubles each time.

    A reader that calls a topic stale after five of its latest gaps (`libraries/runtime/topics.py`) therefore never does
    so because the arm has come to rest.
    """

    def __init__(self) -> None:
        self._last: tuple[StateFrame, PathPoint] | None = None
        self._gap = SHORTEST  # [s]
        self._passed = 0.0  # [s] of the device's clock: the one that passed last

    def passes(self, state: StateFrame, point: PathPoint, longest: float) -> bool:
        """True if `state`, with the commanded `point`, is to be published; `longest` [s] between two at rest."""
        last, self._last = self._last, (state, point)
        is_alike = last is not None and point == last[1] and replace(state, t_us=last[0].t_us) == last[0]
        since = state.t_us * 1e-6 - self._passed
        is_alike = is_alike and since >= 0.0  # else its clock begins anew
        if is_alike and since < self._gap - 0.5 * SHORTEST:
            return False
        self._gap = min(2.0 * self._gap, longest) if is_alike else SHORTEST
        self._passed = state.t_us * 1e-6
        return True
