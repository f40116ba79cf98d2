"""The words of the page in one language; a missing one is an error where it is asked for."""

from __future__ import annotations

from msgspec.structs import replace

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.reasons import PLAIN, FrontEnd, plain, say
from gemelo.schemas.reasons import Reason as Explained
from gemelo.services.panel.model.availability import Reason
from gemelo.services.panel.model.problems import Problem
from gemelo.services.panel.words.en import ENGLISH
from gemelo.services.panel.words.es import SPANISH
from gemelo.services.panel.words.es_device import GOAL_CODES, VALUES
from gemelo.services.panel.words.es_work import WORK
from gemelo.services.panel.words.sentences import Language, Sentences

SPANISH_SENTENCES = Sentences(WORK, VALUES)
LANGUAGES = {  # by the first part of a browser's language; the first one is that of all other browsers
    "en": Language("English", ENGLISH),
    "es": Language("Español", SPANISH, SPANISH_SENTENCES, GOAL_CODES),
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
        return heading, self._table.get(f"text_{problem.text.replace(' ', '_')}") or self._told(problem)

    def why(self, reason: Explained) -> str:
        """The sentence of a reason; of causes that have no code, what `said` makes of them."""
        return as_sentence(say(self._of_known(reason), self.language, FrontEnd.PAGE))

    def _of_known(self, reason: Explained) -> Explained:
        if reason.code == PLAIN:
            return plain(self.said(str(reason)))
        return replace(reason, causes=tuple(self._of_known(cause) for cause in reason.causes))

    def said(self, text: str) -> str:
        """What another part says, line by line; a line that this language does not have is left as it is."""
        return "\n".join(self._of.sentences.of(line) or line for line in text.split("\n"))

    def value(self, name: str, value: str) -> str:
        """A single word of another part, as `name` calls it: a mode, a phase of homing, ..."""
        return self._of.sentences.value(name, value)

    def _told(self, problem: Problem) -> str:
        """By the sentence; where that is not known, by the code, with the sentence as it came."""
        if problem.reason is not None and problem.reason.code != PLAIN:
            return self.why(problem.reason)
        of = self._of.sentences.of
        known = of(problem.text) or of(str(problem.reason or ""))
        about = self._of.codes.get(problem.code)
        return known or (f"{about} («{problem.text}»)" if about else self.said(_without_heading(problem)))


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
