"""`gemelo log`: the log of every node."""

from __future__ import annotations

import datetime

from gemelo.schemas.system import LogLevel, LogRecord
from gemelo.schemas.topics import LOG
from gemelo.tools.cli.common.errors import ExitCode, unknown
from gemelo.tools.cli.common.forms import Form, count_options, form_of, form_options
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.parser import Options, Parser


def log_options(parser: Parser) -> None:
    """Adds level, node, count and form."""
    parser.add_argument("-l", "--level", default="info", help="debug, info, warning, error or fatal, and above")
    parser.add_argument("--node", metavar="NODE", help="only this node")
    count_options(parser, "records")
    form_options(parser)


def run_log(options: Options) -> ExitCode:
    """Follows the log."""
    level = level_of(options.level)
    with connect() as session:
        return follow(session, level, options.node, options.count, form_of(options, line_of))


def level_of(name: str) -> LogLevel:
    """The level of that name; raises `CommandError` with the nearest name."""
    try:
        return LogLevel[name.upper()]
    except KeyError:
        raise unknown("level", name.lower(), [level.name.lower() for level in LogLevel]) from None


def line_of(record: LogRecord) -> str:
    """`12:34:56.789 WARNING planner: text`, in local time."""
    time = datetime.datetime.fromtimestamp(record.stamp / 1e9).strftime("%H:%M:%S.%f")[:-3]
    return f"{time} {record.level.name:<7} {record.node}: {record.text}"


def follow(session: CommandSession, level: LogLevel, node: str | None, count: int | None, form: Form) -> ExitCode:
    """Prints records of `level` and above until Ctrl-C, or `count` of them."""
    printed = 0

    def on_record(record: LogRecord) -> None:
        nonlocal printed
        if record.level < level or node not in (None, record.node) or printed == count:
            return
        printed += 1
        print(form(record), flush=True)
        if printed == count:
            session.node.stop()

    session.node.subscribe(LOG, on_record)
    session.node.spin(lambda now: None, rate=20.0)
    return ExitCode.OK
