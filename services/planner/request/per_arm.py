"""Cache of what depends on the description of an arm alone, kept for the plans to come."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from operator import is_
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


def once_per_arm(make: Callable[P, T]) -> Callable[P, T]:
    """Decorates a function of the arm, and of what else is mostly the same object from plan to plan: its newest result
    is returned again as long as all are the same ones, and is not to be changed. Called by places alone."""
    newest: tuple[tuple[object, ...], T] | None = None

    @wraps(make)
    def kept(*made_of: P.args, **named: P.kwargs) -> T:
        nonlocal newest
        known = newest
        if known is None or not all(map(is_, known[0], made_of)):
            newest = known = (made_of, make(*made_of, **named))
        return known[1]

    return kept
