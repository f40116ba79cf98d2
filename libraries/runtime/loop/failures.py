"""Log of the errors that the handlers and tasks of a service raise: none of them ends the service."""

from __future__ import annotations

import logging
import traceback
from collections import Counter

from gemelo.libraries.runtime.errors import BusError
from gemelo.schemas.errors import ConfigurationError

ENDS = (BusError, ConfigurationError, BrokenPipeError)  # what says that the process itself cannot go on
MOST_PLACES = 64  # in the code that are counted apart; chosen: more than a broken service has


class Failures:
    """Logs each place that fails with its traceback: the first time, the tenth, the hundredth ..."""

    def __init__(self, log: logging.Logger) -> None:
        self._log = log
        self._of: Counter[str] = Counter()

    def take(self, error: Exception) -> None:
        """Raises `error` again where it is one that ends the process."""
        if isinstance(error, ENDS):
            raise error
        place = _place_of(error)
        if place not in self._of and len(self._of) >= MOST_PLACES:
            return
        self._of[place] += 1
        count = self._of[place]
        if str(count).strip("0") == "1":  # 1, 10, 100 ...
            again = f", {count} times by now" if count > 1 else ""
            text = "".join(traceback.format_exception(error))
            self._log.error("a handler failed%s; what it was given is lost, and the service goes on:\n%s", again, text)


def _place_of(error: Exception) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return f"{type(error).__name__} {frames[-1].filename}:{frames[-1].lineno}" if frames else type(error).__name__
