"""Commands about the processes and files: node, param, log, check, version, completion."""

from __future__ import annotations

from pathlib import Path

from services.cli.exits import ExitCode
from services.cli.parser import Command, Options, Parser

GROUPS = {"node": "the nodes that are alive", "param": "the parameters of the nodes"}


def node_list(options: Options) -> ExitCode:
    from services.cli.nodes import listing
    from services.cli.session import connect

    with connect() as session:
        print(listing(session))
    return ExitCode.OK


def node_name(parser: Parser) -> None:
    parser.add_argument("node", metavar="NODE", help="a name of `gemelo node list`")


def node_info(options: Options) -> ExitCode:
    from services.cli.nodes import information
    from services.cli.session import connect

    with connect() as session:
        print(information(session, options.node), end="")
    return ExitCode.OK


def param_list_options(parser: Parser) -> None:
    parser.add_argument("nodes", metavar="NODE", nargs="*", help="all nodes, if none is named")


def param_list(options: Options) -> ExitCode:
    from services.cli.nodes import parameter_table
    from services.cli.session import connect

    with connect() as session:
        print(parameter_table(session, options.nodes))
    return ExitCode.OK


def param_name(parser: Parser) -> None:
    node_name(parser)
    parser.add_argument("parameter", metavar="PARAMETER", help="a name of `gemelo param list NODE`")


def param_get(options: Options) -> ExitCode:
    from services.cli.nodes import parameter_of, written
    from services.cli.session import connect

    with connect() as session:
        print(written(parameter_of(session, options.node, options.parameter).value))
    return ExitCode.OK


def param_set_options(parser: Parser) -> None:
    param_name(parser)
    parser.add_argument("value", metavar="VALUE", help="in the parameter's own type and unit")


def param_set(options: Options) -> ExitCode:
    from services.cli.nodes import set_parameter
    from services.cli.session import connect

    with connect() as session:
        print(set_parameter(session, options.node, options.parameter, options.value))
    return ExitCode.OK


def log_options(parser: Parser) -> None:
    parser.add_argument("-l", "--level", default="info", help="debug, info, warning, error or fatal, and above")
    parser.add_argument("--node", metavar="NODE", help="only this node")


def log(options: Options) -> ExitCode:
    from services.cli.logs import follow, level_of
    from services.cli.session import connect

    level = level_of(options.level)
    with connect() as session:
        return follow(session, level, options.node)


def check_options(parser: Parser) -> None:
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="a robot's folder, as urdf/rm1")


def check(options: Options) -> ExitCode:
    from services.cli.check import check

    return check(options.folder)


def version(options: Options) -> ExitCode:
    from services.cli.version import text

    print(text())
    return ExitCode.OK


def completion(options: Options) -> ExitCode:
    from services.cli.completion import script
    from services.cli.main import COMMANDS

    print(script(COMMANDS), end="")
    return ExitCode.OK


COMMANDS = (
    Command(("node", "list"), "all nodes that are alive", node_list),
    Command(("node", "info"), "what a node publishes, subscribes to and serves", node_info, node_name),
    Command(("param", "list"), "parameters with type, value, default and range", param_list, param_list_options),
    Command(("param", "get"), "one parameter's present value", param_get, param_name),
    Command(("param", "set"), "set a parameter of a running node", param_set, param_set_options),
    Command(("log",), "follow the log of every node, until Ctrl-C", log, log_options),
    Command(("check",), "validate a robot's folder: references, limits, inertias, steps", check, check_options),
    Command(("version",), "the versions of gemelo, of its wire protocol and of Python", version),
    Command(("completion",), "bash completion: source <(gemelo completion)", completion),
)
