"""The error of every file that describes an arm."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, Remedy, because, plain, remedy

PAIR, NAMED = "pair", ("joint", "link")  # a pair is of links; what has a name, though that may be a number


class DescriptionError(ConfigurationError):
    """A robot's folder is wrong."""


class Subject(NamedTuple):
    """What a finding is of: a joint or link with its name, or the robot, the tree, a key, which have none; of two links
    a `PAIR`, whose second is its part."""

    kind: str = ""  # a word of the catalogue; empty where the line says it
    name: str = ""
    part: str = ""  # the element of it, as "<mimic>"
    within: str = ""  # a file that belongs to that of the finding, as its SRDF

    def around(self, what: Reason) -> Reason:
        """What is wrong, with what it is wrong with."""
        if self.within:
            inner = self._replace(within="")
            return because("finding.within", inner.around(what), within=self.within)
        if self.kind == PAIR and self.part:
            return because("finding.pair", what, first=self.name, second=self.part)
        if self.part:
            return because("finding.part", what, kind=self.kind, name=self.name, part=self.part)
        if self.name.isdecimal() and self.kind not in NAMED:
            return because("finding.numbered", what, kind=self.kind, number=self.name)
        if self.name:
            return because("finding.named", what, kind=self.kind, name=self.name)
        return because("finding.of", what, kind=self.kind) if self.kind else what

    def __str__(self) -> str:
        """For example: joint "brazo_joint"."""
        return str(self.around(plain(""))).removesuffix(": ")


def wrong_file(path: Path | str, what: Reason, line: int = 0) -> DescriptionError:
    """The error of a file, at a line (from 1) where that is known."""
    if line:
        return DescriptionError(because("file.line", what, file=str(path), line=line))
    return DescriptionError(because("file.wrong", what, file=str(path)))


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
