"""The person beside the arm: what is asked of him, by which letters he answers, and what his answer means."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence


class Answer(Enum):
    """An answer, by the code of its word: the letter in brackets there is what he types."""

    YES = "selftest.answer.yes"
    NO = "selftest.answer.no"
    WRONG_WAY = "selftest.answer.wrong_way"
    HUMS = "selftest.answer.hums"
    LOST_STEPS = "selftest.answer.lost_steps"
    SKIP = "selftest.answer.skip"
    QUIT = "selftest.answer.quit"


class Outcome(NamedTuple):
    """One check that was made, or left out."""

    check: Reason  # what it was
    answer: Answer
    remedy: Reason | None = None  # where it did not go as it should

    @property
    def is_well(self) -> bool:
        return self.answer in (Answer.YES, Answer.SKIP)


class Left(Exception):
    """The person wants no further check."""


class Person:
    """Reads answers as lines of standard input."""

    def say(self, reason: Reason) -> None:
        """One sentence, which wants no answer."""
        print(sentence(reason), flush=True)

    def ask(self, question: Reason, answers: Sequence[Answer]) -> Answer:
        """One of the answers, or SKIP; an empty line is YES.

        Raises `Left` where he wants no further check, and `CommandError` where nobody answers.
        """
        choices = (*(answers if len(answers) > 1 else ()), Answer.SKIP, Answer.QUIT)
        words = {answer: sentence(because(answer.value)) for answer in choices}
        by_letter = {word.partition("[")[2][:1]: answer for answer, word in words.items()}
        while True:
            print(f"{sentence(question)}\n  {', '.join(words.values())}: ", end="", flush=True)
            line = sys.stdin.readline()
            if not line:
                raise CommandError(because("selftest.nobody"), ExitCode.CANCELLED)
            found = by_letter.get(line.strip()[:1].lower()) if line.strip() else Answer.YES
            if found is Answer.QUIT:
                raise Left
            if found is not None:
                return found
