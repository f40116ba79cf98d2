"""Cache of what depends on the description of an arm alone, kept for the plans to come."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

from services.arm.model.description import Arm

T = TypeVar("T")


def once_per_arm(make: Callable[[Arm], T]) -> Callable[[Arm], T]:
    """Decorates a function of the arm: its newest result is returned again as long as the arm is the same one, and is
    not to be changed."""
    newest: tuple[Arm, T] | None = None

    @wraps(make)
    def kept(arm: Arm) -> T:
        nonlocal newest
        known = newest
        if known is None or known[0] is not arm:
            newest = known = (arm, make(arm))
        return known[1]

    return kept
