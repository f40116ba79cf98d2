"""A language of the page: its own words; those of other parts are in the catalogue of schemas/reasons."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Language:
    """A language of the page."""

    name: str  # as its speakers call it
    table: Mapping[str, str]  # the page's own words, by the keys of the English ones
    values: Mapping[str, Mapping[str, str]] = field(default_factory=dict)  # a mode's, a phase's: by kind, then by word
