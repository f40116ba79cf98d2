"""Where jogging begins: where the arm was measured to stand."""

from __future__ import annotations

from schemas.joints import JointState
from services.arm.description import Arm
from services.planner.refusals import NoPlan
from services.planner.start import resolve_start


class JogRefused(ValueError):
    """The arm cannot be jogged now; the text says why and what would do."""


def standing_position(arm: Arm, present: JointState | None, age: float) -> tuple[float, ...]:
    """[rad] or [m] in the arm's order, of an arm that stands; raises `JogRefused`."""
    try:
        return resolve_start(arm, None, present, age)
    except NoPlan as no_plan:
        raise JogRefused(f"{no_plan.refusal.message}; {no_plan.refusal.remedy}") from no_plan
