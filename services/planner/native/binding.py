"""The compiled module `_motion`, or an error with the remedy where it has not been built."""

from __future__ import annotations


class NativeMissing(ImportError):
    """The motion core has not been built for this interpreter."""


try:
    from gemelo.services.planner.native import _motion as motion
except ImportError as error:
    raise NativeMissing(
        f"the native planner cannot be loaded ({error}): run `make setup`; where it says that Python.h is missing, "
        "`sudo apt-get install python3-dev` first"
    ) from error

CancelFlag = motion.CancelFlag

__all__ = ["CancelFlag", "NativeMissing", "motion"]
