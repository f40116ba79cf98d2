"""The choice of what computes, made here and nowhere else: the compiled core, or Python where that is not built.

Where both can do it, the function of the compiled core stands under `where_built`, which names the one in Python; the
tests hold the two against one another.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

try:
    from gemelo.services.planner.native.binding import CancelFlag, motion
    from gemelo.services.planner.native.model_cache import cached_rows
    from gemelo.services.planner.native.native_planner import NativePlanner
    from gemelo.services.planner.native.tool_descent import NativeDescent
except ImportError:  # not built for this interpreter, or hidden
    motion = None  # type: ignore[assignment]

IN_PYTHON = motion is None

Function = TypeVar("Function", bound=Callable[..., object])

__all__ = ["IN_PYTHON", "CancelFlag", "NativeDescent", "NativePlanner", "cached_rows", "motion", "where_built"]


def where_built(in_python: Callable[..., object]) -> Callable[[Function], Function]:
    """Decorates a function of the compiled core: where that is not built, `in_python` takes its place."""

    def chosen(compiled: Function) -> Function:
        return cast(Function, in_python) if IN_PYTHON else compiled

    return chosen
