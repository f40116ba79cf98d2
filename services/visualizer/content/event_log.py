"""The event log since the last batch: log records, events of the device, and lost steps."""

from __future__ import annotations

import numpy as np

from gemelo.schemas.device import DeviceEvent
from gemelo.schemas.reasons import because, say
from gemelo.schemas.reasons.catalogue import ENGLISH
from gemelo.schemas.system import LogRecord
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.thinning import LAST_STAMP
from gemelo.services.visualizer.content.updates import LogLines, Update

AGAIN = 60_000_000_000  # [ns] after which the newest line is said again: a viewer that comes late has only some minutes
EVENT_LEVELS = {"fault": "ERROR", "estop": "ERROR", "homing_stopped": "WARNING", "inject_refused": "WARNING"}


class EventLog:
    """Lines with their time and level, until they are taken."""

    def __init__(self, language: str = ENGLISH) -> None:
        """`language` is that of its own words; what a node or device reports stays as it is."""
        self._language = language
        self._lines: list[tuple[int, str, str]] = []  # [ns], text, level
        self._newest: tuple[int, str, str] | None = None
        self._sent = 0  # [ns] when a line was sent last

    def add(self, stamp: int, text: str, level: str = "INFO") -> None:
        """`stamp` in ns UNIX; `level` as in `LogLevel`'s names."""
        self._lines.append((clamp_stamp(stamp), text, level))

    def on_log(self, message: LogRecord) -> None:
        """A line of a node."""
        self.add(message.stamp, f"{message.node}: {message.text}", message.level.name)

    def on_event(self, message: DeviceEvent) -> None:
        """Something that the device reports once."""
        text = f"{message.device}: {message.event}" + (f" ({message.detail})" if message.detail else "")
        self.add(message.stamp, text, EVENT_LEVELS.get(message.event, "INFO"))

    def say_again(self) -> None:
        """The newest line is for a new viewer too."""
        self._sent = 0

    def take(self, now: int, latest: int = LAST_STAMP) -> list[Update]:
        """The lines since the last call; one of after `latest` [ns] is of then. Where nothing is new for `AGAIN`, the
        newest one once more."""
        lines, self._lines = self._lines, []
        if lines:
            self._newest = lines[-1]
        elif self._newest is not None and now - self._sent >= AGAIN:
            at, text, level = self._newest
            again = because("view.nothing_new", time=time_of_day(at), text=text)
            lines = [(now, say(again, self._language), level)]
        if not lines:
            return []
        self._sent = now
        stamps, said, levels = zip(*((min(stamp, latest), *line) for stamp, *line in lines), strict=True)
        texts = tuple(f"{time_of_day(stamp)} {text}" for stamp, text in zip(stamps, said, strict=True))
        return [LogLines(entities.LOG, np.array(stamps, dtype=np.int64), texts, levels)]


def time_of_day(stamp: int) -> str:
    """UTC to the second, of ns UNIX."""
    minutes, seconds = divmod(stamp // 1_000_000_000 % 86_400, 60)
    return f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}"


def clamp_stamp(stamp: int) -> int:
    """`stamp` as a time column can hold it."""
    return min(max(stamp, 0), LAST_STAMP)
