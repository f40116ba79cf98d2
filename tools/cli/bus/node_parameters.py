"""`gemelo param dump` and `load`: the parameters of running nodes as a TOML file, and back."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import NamedTuple

from gemelo.libraries.runtime.saved_parameters import toml
from gemelo.schemas.reasons import because
from gemelo.schemas.system import Parameter, ParameterValue
from gemelo.schemas.text_file import NotUtf8, decode_text
from gemelo.tools.cli.bus.node import living
from gemelo.tools.cli.bus.param import (
    change_parameter,
    parameter_of,
    parameters_of,
    require_in_range,
    value_of,
    written,
)
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.parser import Options, Parser


class NewValue(NamedTuple):
    """A parameter of a node, and the value that it is to have."""

    node: str
    parameter: Parameter
    value: ParameterValue


def dump_options(parser: Parser) -> None:
    """Adds the nodes."""
    parser.add_argument("nodes", metavar="NODE", nargs="*", help="all nodes, if none is named")


def run_dump(options: Options) -> ExitCode:
    """Prints TOML."""
    with connect() as session:
        print(dumped(session, options.nodes), end="")
    return ExitCode.OK


def load_options(parser: Parser) -> None:
    """Adds the file and --save."""
    parser.add_argument("file", metavar="FILE", help="as `param dump` writes it, or - for standard input")
    parser.add_argument("--save", action="store_true", help="keep all of it beyond the end of the processes")


def run_load(options: Options) -> ExitCode:
    """Sets parameters."""
    tables = read(options.file)
    with connect() as session:
        for line in load(session, tables, options.save):
            print(line)
    return ExitCode.OK


def dumped(session: CommandSession, names: list[str]) -> str:
    """A table for every node that has parameters; ranges and meanings are comments."""
    blocks = []
    for name in names or living(session):
        lines = [
            f"{toml(each.name)} = {toml(each.value)}{f'  # {each.description}' if each.description else ''}"
            for each in parameters_of(session, name)
        ]
        if lines:
            blocks.append("\n".join([f"[{toml(name)}]", *lines]))
    return "\n\n".join(blocks) + "\n"


def read(file: str) -> dict[str, dict[str, object]]:
    """The tables of a file, by node; raises `CommandError`."""
    try:
        text = decode_text(sys.stdin.buffer.read() if file == "-" else Path(file).read_bytes())
        tables = tomllib.loads(text)
    except (OSError, NotUtf8, tomllib.TOMLDecodeError) as error:
        raise usage(because("cli.parameters.unreadable", file=str(file), error=str(error))) from error
    for node, table in tables.items():
        if not isinstance(table, dict):
            raise usage(because("cli.parameters.outside", file=str(file), name=str(node)))
    return tables


def load(session: CommandSession, tables: dict[str, dict[str, object]], save: bool = False) -> list[str]:
    """Sets what differs, or saves all; a line for each. Where one is refused, those before it are set back."""
    changes = [_change(session, node, name, value) for node, table in tables.items() for name, value in table.items()]
    lines: list[str] = []
    done: list[NewValue] = []
    for change in changes:
        if change.value == change.parameter.value and not save:
            continue
        try:
            lines.append(change_parameter(session, change.node, change.parameter, change.value, save))
        except Exception:
            for before in reversed(done):
                change_parameter(session, before.node, before.parameter, before.parameter.value, save)
            raise
        done.append(change)
    return lines or ["every parameter has that value already"]


def _change(session: CommandSession, node: str, name: str, value: object) -> NewValue:
    """Checked for its type and its range, before anything is set."""
    parameter = parameter_of(session, node, name)
    if not isinstance(value, bool | int | float | str):
        raise CommandError(because("cli.parameters.value", node=node, name=name, value=repr(value)))
    if isinstance(value, str) != (parameter.type == "str"):
        raise usage(because("cli.parameters.type", value=repr(value), type=str(parameter.type), name=name, node=node))
    wanted = value_of(parameter, written(value))
    require_in_range(node, parameter, wanted)
    return NewValue(node, parameter, wanted)
