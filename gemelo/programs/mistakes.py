"""A mistake in a file of points or a program: its place in the file, and what is wrong with the remedy."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gemelo.api.errors import Error
from gemelo.programs.steps import StepPath, path_text
from gemelo.schemas.reasons import Reason, because


class Mistake(NamedTuple):
    """One mistake; `str` is the sentence."""

    file: str  # or the program's name, where it was read from no file
    line: int  # from 1; 0 where it is not known
    step: StepPath  # empty where it is in no step
    what: Reason  # the thing, its value and the remedy

    @property
    def reason(self) -> Reason:
        """What is wrong, with its place."""
        if self.line and self.step:
            return because("file.line.step", self.what, file=self.file, line=self.line, step=path_text(self.step))
        if self.line:
            return because("file.line", self.what, file=self.file, line=self.line)
        if self.step:
            return because("file.step", self.what, file=self.file, step=path_text(self.step))
        return because("file.wrong", self.what, file=self.file)

    def __str__(self) -> str:
        return str(self.reason)


class ProgramError(Error):
    """A file of points or a program that cannot be used; the text has a line for every mistake."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)  # in the order of the file
        reasons = [mistake.reason for mistake in self.mistakes]
        super().__init__(reasons[0] if len(reasons) == 1 else because("file.mistakes", *reasons))
