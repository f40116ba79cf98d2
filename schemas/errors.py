"""Errors whose sentence is that of a reason, and the error of every file that a person writes."""

from __future__ import annotations

from gemelo.schemas.reasons import Reason, plain


class ReasonedError(Exception):
    """An error that says why by a code with values; its text is the English sentence of that."""

    def __init__(self, reason: Reason | str = "") -> None:
        """A text is a sentence that has no code."""
        super().__init__(reason)
        self.reason = reason if isinstance(reason, Reason) else plain(reason)

    def __str__(self) -> str:
        return str(self.reason)


class ConfigurationError(ReasonedError, ValueError):
    """A file is wrong; the text names it, the thing, its value and, where known, the remedy."""
