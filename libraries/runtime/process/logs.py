"""A node's log: one line on stderr, and a `LogRecord` on the bus; what its handlers raise is in it too."""

from __future__ import annotations

import logging
import sys
import time
import traceback
from collections import Counter
from collections.abc import Callable

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.errors import BusError
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.plain_text import escaped
from gemelo.schemas.system import LogLevel, LogRecord

LEVELS = ("debug", "info", "warning", "error")
MAX_TEXT = 8_000  # characters of one record on the bus
ENDS = (BusError, ConfigurationError, BrokenPipeError)  # what says that the process itself cannot go on
MOST_PLACES = 64  # in the code that are counted apart; chosen: more than a broken service has


class LineFormatter(logging.Formatter):
    """`12:00:01.234 planner INFO text`, in local time; control characters of others are escaped."""

    def format(self, record: logging.LogRecord) -> str:
        clock = time.strftime("%H:%M:%S", time.localtime(record.created))
        line = f"{clock}.{int(record.msecs):03d} {record.name} {record.levelname} {record.getMessage()}"
        return escaped(f"{line}\n{self.formatException(record.exc_info)}" if record.exc_info else line)


class BusHandler(logging.Handler):
    """Puts every record on the LOG topic."""

    def __init__(self, put: Callable[[LogRecord], None], clock: Clock = SYSTEM) -> None:
        super().__init__()
        self._put, self._clock = put, clock
        self._is_busy = False

    def emit(self, record: logging.LogRecord) -> None:
        if self._is_busy:
            return
        self._is_busy = True
        try:
            text = record.getMessage()
            if record.exc_info and record.exc_info[1] is not None:
                text += f": {type(record.exc_info[1]).__name__}: {record.exc_info[1]}"
            level = max((each for each in LogLevel if each <= record.levelno), default=LogLevel.DEBUG)
            stamp = self._clock.unix() if self._clock.is_virtual else int(record.created * 1e9)
            self._put(LogRecord(stamp=stamp, node=record.name, level=level, text=text[:MAX_TEXT]))
        except Exception:
            self.handleError(record)  # on stderr: a log that cannot be sent must not end a node
        finally:
            self._is_busy = False


def line_logger(name: str, level: str = "info") -> logging.Logger:
    """A logger that writes lines to stderr, apart from Python's root logger."""
    logger = logging.Logger(name, level.upper())
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(LineFormatter())
    logger.addHandler(handler)
    return logger


class Failures:
    """Logs each place of a service that fails, with its traceback: the first time, the tenth, the hundredth ..."""

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
