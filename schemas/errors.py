"""The error of every file that a person writes."""

from __future__ import annotations


class ConfigurationError(ValueError):
    """A file is wrong; the text names it, the thing, its value and, where known, the remedy."""
