"""A node's log: one line on stderr, and a `LogRecord` on the bus."""

from __future__ import annotations

import logging
import sys
import time
from collections.abc import Callable

from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.schemas.plain_text import escaped
from gemelo.schemas.system import LogLevel, LogRecord

LEVELS = ("debug", "info", "warning", "error")
MAX_TEXT = 8_000  # characters of one record on the bus


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
