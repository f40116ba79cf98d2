"""Questions to a person about what a URDF cannot say: answered by a file, by defaults, or on the terminal."""

from __future__ import annotations

import json
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from gemelo.libraries.arm.errors import DescriptionError, nearest, wrong_file
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.text_file import NotUtf8, read_text

T = TypeVar("T")


class Questions:
    """Each question has a key, by which its answer is kept and can be given again."""

    def __init__(self, given: dict[str, str], takes_defaults: bool, say: Callable[[Reason], str] = str) -> None:
        self.say = say  # the sentence of a reason, in the language of who is asked
        self.answers: dict[str, str] = {}
        self._given, self._takes_defaults = given, takes_defaults
        self._by_default: set[str] = set()

    def ask(self, key: str, question: Reason, default: str, parse: Callable[[str], T]) -> T:
        """The answer as `parse` reads it; raises `DescriptionError` where a given one is refused."""
        if key in self._given:
            return self._parsed(key, self._given[key], parse)
        if self._takes_defaults:
            self._by_default.add(key)
            return self._parsed(key, default, parse)
        if not sys.stdin.isatty():
            raise DescriptionError(because("import.question.nobody", key=key))
        while True:
            print(f"  {self.say(question)} [{default}] ", end="", flush=True)
            said = sys.stdin.readline()
            if not said:
                raise DescriptionError(because("import.question.no_answer", key=key))
            try:
                return self._parsed(key, said.strip() or default, parse)
            except DescriptionError as error:
                print(f"  {self.say(error.reason)}")

    def ask_somebody(self, key: str, question: Reason, default: str, parse: Callable[[str], T]) -> T:
        """As `ask`; the default where it was not given and nobody is there to be asked."""
        return self.ask(key, question, default, parse) if key in self._given or sys.stdin.isatty() else parse(default)

    def ask_without_default(self, key: str, question: Reason, parse: Callable[[str], T]) -> T | None:
        """As `ask`, of what has no default; None where it was not given and nobody is there to be asked."""
        if key not in self._given and (self._takes_defaults or not sys.stdin.isatty()):
            return None
        return (
            self._parsed(key, self.answers[key], parse) if key in self.answers else self.ask(key, question, "", parse)
        )

    def rehearsal(self) -> Questions:
        """The same given answers, and defaults for all else."""
        return Questions(self._given, takes_defaults=True, say=self.say)

    def given_below(self, prefix: str) -> dict[str, str]:
        """The given answers whose keys begin with `prefix`, by what follows it; they count as asked for."""
        below = {key: value for key, value in self._given.items() if key.startswith(prefix)}
        self.answers |= below
        return {key.removeprefix(prefix): value for key, value in below.items()}

    def was_given(self, key: str) -> bool:
        """True if a person said it: in the file of answers, or on the terminal, where even a default was looked at."""
        return key in self.answers and key not in self._by_default

    def unused(self) -> list[Reason]:
        """What was given and never asked, with a hint: a misspelt key has no effect."""
        left = [key for key in self._given if key not in self.answers]
        return [because("import.answers.key", nearest(key, self.answers), key=key) for key in left]

    def _parsed(self, key: str, text: str, parse: Callable[[str], T]) -> T:
        try:
            value = parse(text)
        except ValueError as error:
            why = error.reason if isinstance(error, ReasonedError) else plain(str(error))
            raise DescriptionError(because("import.answer", why, key=key, text=text)) from error
        self.answers[key] = text
        return value


def read_answers(file: Path) -> dict[str, str]:
    """Of a file that an import wrote; raises `DescriptionError`."""
    try:
        data = tomllib.loads(read_text(file))
    except tomllib.TOMLDecodeError as error:
        raise wrong_file(file, because("import.answers.not_toml", problem=str(error))) from error
    except NotUtf8 as error:
        raise wrong_file(file, error.reason) from error
    except OSError as error:
        raise wrong_file(file, because("file.unreadable", error=error.strerror or str(error))) from error
    for key, value in data.items():
        if isinstance(value, (dict, list)):
            raise wrong_file(file, because("import.answers.several", key=key))
    return {key: value if isinstance(value, str) else str(value).lower() for key, value in data.items()}


def answers_text(answers: dict[str, str]) -> str:
    """As `read_answers` reads them."""
    lines = [f"{json.dumps(key)} = {json.dumps(value)}" for key, value in answers.items()]
    return "# What `gemelo import` asked, for `--answers`.\n" + "\n".join(lines) + "\n"


class BadAnswer(ReasonedError, ValueError):
    """Why an answer is none to its question."""


def yes_or_no(text: str) -> bool:
    """Raises ValueError."""
    words = {"yes": True, "y": True, "si": True, "s": True, "true": True, "no": False, "n": False, "false": False}
    if text.lower() not in words:
        raise BadAnswer(because("import.answer.yes_or_no"))
    return words[text.lower()]


def whole(text: str) -> int:
    """Raises ValueError."""
    try:
        return int(text)
    except ValueError:
        raise BadAnswer(because("import.answer.whole")) from None


def number(text: str) -> float:
    """A finite one, in the unit of its question; raises ValueError."""
    try:
        value = float(text)
    except ValueError:
        raise BadAnswer(because("import.answer.number")) from None
    if not abs(value) < float("inf"):
        raise BadAnswer(because("import.answer.finite"))
    return value


def above_zero(text: str) -> float:
    """A number above 0, in the unit of its question; raises ValueError."""
    value = number(text)
    if not value > 0.0:
        raise BadAnswer(because("import.answer.above_zero"))
    return value


def one_of(*words: str) -> Callable[[str], str]:
    """A reader that raises ValueError for every other word."""

    def read(text: str) -> str:
        if text not in words:
            raise BadAnswer(because("import.answer.none_of", known=words))
        return text

    return read
