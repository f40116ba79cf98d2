"""`gemelo node`: the living nodes."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

import msgspec

from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.schemas.system import Empty, NodeInfo
from gemelo.tools.cli.bus.messages import dump
from gemelo.tools.cli.common.errors import CommandError, ExitCode, unknown
from gemelo.tools.cli.common.forms import print_value
from gemelo.tools.cli.common.language import columns, reason_or, word
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser, json_option

TIMEOUT = 2.0  # [s]


def run_list(options: Options) -> ExitCode:
    """Prints the table of living nodes."""
    with connect() as session:
        found = standings(session)
    return print_value(found, options.json, lambda: listing(found))


def node_option(parser: Parser) -> None:
    """Adds the node."""
    parser.add_argument("node", metavar="NODE", help="a name of `gemelo node list`")


def info_options(parser: Parser) -> None:
    """Adds the node and --json."""
    node_option(parser)
    json_option(parser)


def run_info(options: Options) -> ExitCode:
    """Prints one node."""
    with connect() as session:
        info = information_of(session, options.node)
    return print_value(info, options.json, lambda: dump(info))


def information_of(session: CommandSession, name: str) -> NodeInfo:
    """The keys that a node publishes, subscribes to and serves; raises `CommandError` if no such node is alive."""
    from gemelo.libraries.runtime.endpoints import info_request  # slow to load: all that a node has on the bus

    require_alive(session, name)
    return session.node.call(info_request(name), Empty(), timeout=TIMEOUT)


def told_information_of(session: CommandSession, name: str) -> NodeInfo | None:
    """As `information_of`; None of a node that does not answer, or has just ended."""
    from gemelo.libraries.runtime.errors import NoAnswer  # 0.1 s, for a command that connects

    try:
        return information_of(session, name)
    except (NoAnswer, CommandError):
        return None


def require_alive(session: CommandSession, name: str) -> None:
    """Raises `CommandError` with the nearest name if no such node is alive."""
    alive = living(session)
    if name not in alive:
        error = unknown("node", name, alive)
        raise CommandError(error, ExitCode.FAILED)


def living(session: CommandSession) -> list[str]:
    """The nodes that are alive, other than this command's own."""
    return [address for address in sorted(session.node.alive()) if not is_command(address)]


def is_command(address: str) -> bool:
    """True for a command's own node."""
    return address.rpartition("/")[2].startswith("cli-")


class NodeState(msgspec.Struct, frozen=True, kw_only=True):
    """How a node is; `info` is None for one that does not answer."""

    node: str
    info: NodeInfo | None = None
    clock: ClockOffset | None = None  # against this host's


def standings(session: CommandSession) -> list[NodeState]:
    """Of every living node."""
    from gemelo.libraries.runtime.errors import NoAnswer  # 0.1 s, for a command that connects
    from gemelo.libraries.runtime.node_clock import ask_about

    found = []
    for name in living(session):
        try:
            info, clock = ask_about(session.node, name, TIMEOUT)
        except NoAnswer:  # it hangs, or has just ended
            found.append(NodeState(node=name))
        else:
            found.append(NodeState(node=name, info=info, clock=clock))
    return found


def listing(found: Sequence[NodeState]) -> str:
    """The table for a person."""
    headings = columns("node", "robot", "host", "pid", "version", "started [local time]", "ready", "clock")
    return table(headings, [_cells(each) for each in found])


def _cells(each: NodeState) -> Sequence[str]:
    info = each.info
    if info is None:
        return (each.node, "-", "-", "-", "-", "-", "does not answer", "-")
    started = datetime.datetime.fromtimestamp(info.started / 1e9).strftime("%H:%M:%S")
    yes, no = word("device_line", "yes"), word("device_line", "no")
    ready = yes if info.ready else reason_or(info.why, info.problem) or no
    clock = "-" if each.clock is None else str(each.clock)
    return (each.node, info.robot, info.host, str(info.pid), info.version, started, ready, clock)
