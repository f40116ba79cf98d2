"""The error of every file that describes an arm."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Remedy, remedy


class DescriptionError(ConfigurationError):
    """A robot's folder is wrong."""


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """The known name that `name` was probably meant to be, or None when nothing is near."""
    near = difflib.get_close_matches(name, list(known), n=1, cutoff=0.5)
    return near[0] if near else None


def nearest(name: str, known: Iterable[str]) -> Remedy:
    """The known name that is most alike, or all that there are."""
    names = tuple(sorted(known))
    if near := nearest_name(name, names):
        return remedy("did_you_mean", name=near)
    return remedy("known_are", names=names) if names else remedy("none_known")


def suggestion(name: str, known: Iterable[str]) -> str:
    """`"; did you mean "x"?"`, or the list of what there is."""
    names = sorted(known)
    near = nearest_name(name, names)
    if near:
        return f'; did you mean "{near}"?'
    return f"; known are {', '.join(names)}" if names else "; none is known"
