"""The reason of an error that ends a step of chaos."""

from __future__ import annotations

import gemelo
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, plain


def cause_of(error: BaseException) -> Reason:
    """That which the error carries; its text where it carries none."""
    if isinstance(error, gemelo.Error):
        return error.message
    return error.reason if isinstance(error, ReasonedError) else plain(str(error))
