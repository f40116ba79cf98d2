"""A mistake in a file of points or a program: its place in the file, a sentence and the remedy."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from gemelo.api.errors import Error
from gemelo.programs.steps import StepPath, path_text


class Mistake(NamedTuple):
    """One mistake; `str` is the sentence."""

    file: str  # or the program's name, where it was read from no file
    line: int  # from 1; 0 where it is not known
    step: StepPath  # empty where it is in no step
    what: str  # the thing, its value and the remedy

    def __str__(self) -> str:
        where = f"{self.file}, line {self.line}" if self.line else self.file
        step = f"step {path_text(self.step)}: " if self.step else ""
        return f"{where}: {step}{self.what}"


class ProgramError(Error):
    """A file of points or a program that cannot be used; the text has a line for every mistake."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(mistakes)  # in the order of the file
        super().__init__("\n".join(str(mistake) for mistake in self.mistakes))
