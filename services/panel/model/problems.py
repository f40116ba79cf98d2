"""An error as the page shows it: a sentence, the check, what touches, and the nearest goal that is possible."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from typing import ParamSpec

import gemelo
from gemelo.schemas.reasons import Reason
from gemelo.schemas.scene import Contact

P = ParamSpec("P")
NEAR = 1e-3  # of two values of the same thing, in the unit of the check, that are told as one


@dataclass(frozen=True)
class Problem:
    """Why something cannot be, or has ended; the words are those of `gemelo`, the check can be translated."""

    text: str
    check: str = ""  # as in `gemelo.Refused.check`
    remedy: str = ""
    nearest: gemelo.Target = field(default_factory=lambda: gemelo.Target())
    contacts: tuple[Contact, ...] = ()
    subject: str = ""  # of the check: a joint, a pair "one / other", an axis
    value: float | None = None  # of the subject, in the unit of the check
    limit: float | None = None  # that the value is beyond
    is_refusal: bool = True  # False: something moved, and ended before its goal
    reason: Reason | None = None  # as data, of who refused

    @property
    def has_nearest(self) -> bool:
        return bool(self.nearest)

    def is_same(self, other: Problem) -> bool:
        """True if both tell a person the same: a goal is checked while it is set, and again when it is planned."""
        if self.text == other.text:
            return True
        near = abs((self.value or 0.0) - (other.value or 0.0)) < NEAR
        return near and bool(self.subject) and (self.check, self.subject) == (other.check, other.subject)


def problem_of(error: Exception) -> Problem:
    """The error as a problem; one that is not of `gemelo` keeps its kind in the text."""
    if isinstance(error, gemelo.Refused):
        return Problem(
            str(error), error.check, error.remedy, error.nearest, error.contacts,
            error.subject, error.value, error.limit, reason=error.reason,
        )  # fmt: skip
    if isinstance(error, gemelo.Aborted):
        return Problem(str(error), error.status.name.lower(), is_refusal=False, reason=error.reason)
    if isinstance(error, gemelo.Error):
        return Problem(str(error), "lost" if isinstance(error, gemelo.Lost) else "argument", reason=error.reason)
    return Problem(f"{type(error).__name__}: {error}", "defect")


def reporting(tell: Callable[[Problem], object], action: Callable[P, object]) -> Callable[P, None]:
    """`action`, whose errors are told instead of raised: a press on a button has no caller that could catch them."""

    @wraps(action)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            action(*args, **kwargs)
        except Exception as error:
            tell(problem_of(error))

    return run
