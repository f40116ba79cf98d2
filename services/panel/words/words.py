"""The words of the page in one language; a missing one is an error where it is asked for."""

from __future__ import annotations

from services.panel.model.availability import Reason
from services.panel.model.problems import Problem
from services.panel.words.en import ENGLISH
from services.panel.words.es import SPANISH
from services.panel.words.es_refusals import REFUSALS
from services.panel.words.refusals import Joints, key_of, sentence_of

TABLES = {"en": ENGLISH, "es": SPANISH}
SENTENCES: dict[str, dict[str, str]] = {"en": {}, "es": REFUSALS}  # in English the planner's own are shown
NAMES = {"en": "English", "es": "Español"}


class Words:
    """`words("key", name=value)` is the text of the key with its values put in."""

    def __init__(self, language: str, joints: Joints | None = None) -> None:
        self.language = language if language in TABLES else "en"
        self._joints = joints or {}
        self._table = TABLES[self.language]

    def __call__(self, key: str, **values: object) -> str:
        text = self._table[key]
        return text.format(**values) if values else text

    def reason(self, reason: Reason) -> str:
        """Why something cannot be done now; empty where it can."""
        return "" if reason is None else self(f"reason_{reason[0]}", value=reason[1])

    def check(self, check: str) -> str:
        """What a check that refuses or limits is called; empty where the table has no name for it."""
        return self._table.get(f"check_{key_of(check)}", "")

    def problem(self, problem: Problem) -> tuple[str, str]:
        """A heading for the check, and a sentence; where this language has none, that of the part that refused."""
        heading = self.check(problem.check) or self("check_other" if problem.is_refusal else "check_ended")
        known = self._table.get(f"text_{problem.text.replace(' ', '_')}")
        return heading, known or sentence_of(problem, self._joints, SENTENCES[self.language]) or problem.text


def language_of(browser: str) -> str:
    """The nearest of our languages to a browser's, as "es-MX"."""
    short = browser.partition("-")[0].lower()
    return short if short in TABLES else "en"
