"""The one place where it is decided what computes: the compiled core, or the same in numpy where it has not been built.

A module that has both asks `IS_BUILT`; its version in numpy is what the tests compare the compiled one to.
"""

from __future__ import annotations

try:
    from services.planner.native.binding import motion
except ImportError:  # not built for this interpreter, or hidden
    motion = None  # type: ignore[assignment]

IS_BUILT = motion is not None

__all__ = ["IS_BUILT", "motion"]
