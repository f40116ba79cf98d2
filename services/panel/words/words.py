"""The words of the page in one language; a missing one is an error where it is asked for."""

from __future__ import annotations

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.reasons import PLAIN, FrontEnd, say
from gemelo.schemas.reasons import Reason as Explained
from gemelo.services.panel.model.availability import Reason
from gemelo.services.panel.model.problems import Problem
from gemelo.services.panel.words import en, es

LANGUAGES = {  # by the first part of a browser's language; the first one is that of all other browsers
    "en": en.LANGUAGE,
    "es": es.LANGUAGE,
}


class Words:
    """`words("key", name=value)` is the text of the key with its values put in."""

    def __init__(self, language: str) -> None:
        self.language = language if language in LANGUAGES else next(iter(LANGUAGES))
        self._of = LANGUAGES[self.language]
        self._table = self._of.table

    def __call__(self, key: str, **values: object) -> str:
        text = self._table[key]
        return text.format(**values) if values else text

    def reason(self, reason: Reason) -> str:
        """Why something cannot be done now; empty where it can."""
        return "" if reason is None else self(f"reason_{reason[0]}", value=self.value("mode", reason[1]))

    def ended(self, status: GoalStatusCode) -> str:
        """How a motion that is over has ended; nobody knows it of one whose gateway was lost on the way."""
        return self(f"ended_{status.name.lower()}" if status.is_terminal else "ended_unknown")

    def check(self, check: str) -> str:
        """What a check that refuses or limits is called; empty where the table has no name for it."""
        return self._table.get(f"check_{check.replace('-', ' ').replace(' ', '_')}", "")

    def problem(self, problem: Problem) -> tuple[str, str]:
        """A heading for the check, and a sentence; where this language has none, that of the part that refused."""
        heading = self.check(problem.check) or self("check_other" if problem.is_refusal else "check_ended")
        return heading, self._table.get(f"text_{problem.text.replace(' ', '_')}") or self._sentence_of(problem)

    def _sentence_of(self, problem: Problem) -> str:
        """That of its reason; an older program sent a text alone, which stays as it came."""
        has_code = problem.reason is not None and problem.reason.code != PLAIN
        return self.why(problem.reason) if has_code and problem.reason is not None else _without_heading(problem)

    def why(self, reason: Explained) -> str:
        """The sentence of a reason."""
        return as_sentence(self.line(reason))

    def line(self, reason: Explained) -> str:
        """The same without a full stop, as one line of several."""
        return say(reason, self.language, FrontEnd.PAGE)

    def value(self, name: str, value: str) -> str:
        """A single word of another part, as `name` calls it: a mode, a phase of homing, ..."""
        return self._of.values.get(name, {}).get(value, value)


def _without_heading(problem: Problem) -> str:
    """The sentence of the part that refused, without its check, which is the heading, and without the arguments of the
    nearest that can, which a button takes."""
    if not problem.text.startswith(f"refused ({problem.check})"):
        return problem.text
    return ": ".join(filter(None, (str(problem.reason or ""), "" if problem.has_nearest else problem.remedy)))


def as_sentence(text: str) -> str:
    """With its full stop."""
    return text if text.endswith((".", "?", "!")) else f"{text}."


def language_of(browser: str) -> str:
    """The nearest of our languages to a browser's, as "es-MX"."""
    short = browser.partition("-")[0].lower()
    return short if short in LANGUAGES else next(iter(LANGUAGES))
