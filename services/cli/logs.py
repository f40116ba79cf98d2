"""`gemelo log`: what every node says, as it says it."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

from schemas.system import LogLevel, LogRecord
from schemas.topics import LOG
from services.cli.exits import ExitCode
from services.cli.names import unknown

if TYPE_CHECKING:
    from services.cli.session import Session


def level_of(name: str) -> LogLevel:
    """The level that a person named."""
    try:
        return LogLevel[name.upper()]
    except KeyError:
        raise unknown("level", name.lower(), [level.name.lower() for level in LogLevel]) from None


def line_of(record: LogRecord) -> str:
    """`12:34:56.789 WARNING planner: text`, in local time."""
    time = datetime.datetime.fromtimestamp(record.stamp / 1e9).strftime("%H:%M:%S.%f")[:-3]
    return f"{time} {record.level.name:<7} {record.node}: {record.text}"


def follow(session: Session, level: LogLevel, node: str | None) -> ExitCode:
    """Prints records of `level` and above until Ctrl-C."""

    def on_record(record: LogRecord) -> None:
        if record.level >= level and node in (None, record.node):
            print(line_of(record), flush=True)

    session.node.subscribe(LOG, on_record)
    session.node.spin(lambda now: None, rate=20.0)
    return ExitCode.OK
