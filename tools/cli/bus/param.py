"""`gemelo param`: the parameters of running nodes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import msgspec

from gemelo.schemas.reasons import because
from gemelo.schemas.system import Empty, Parameter, ParameterValue, SetParameter
from gemelo.tools.cli.bus.messages import dump
from gemelo.tools.cli.bus.node import TIMEOUT, living, node_option, require_alive
from gemelo.tools.cli.common.errors import CommandError, ExitCode, hint_of, usage
from gemelo.tools.cli.common.forms import print_value
from gemelo.tools.cli.common.language import columns, sentence, translated
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options, Parser, json_option


def parameters_options(parser: Parser) -> None:
    """Adds the nodes and --json."""
    json_option(parser)
    parser.add_argument("nodes", metavar="NODE", nargs="*", help="all nodes, if none is named")


def run_parameters(options: Options) -> ExitCode:
    """Prints the table of parameters."""
    with connect() as session:
        found = [NodeParameters(name, parameters_of(session, name)) for name in options.nodes or living(session)]
    rows = [{"node": name} | msgspec.structs.asdict(each) for name, declared in found for each in declared]
    return print_value(rows, options.json, lambda: parameter_table(found))


def parameter_options(parser: Parser) -> None:
    """Adds node, parameter and --json."""
    named_options(parser)
    json_option(parser)


def named_options(parser: Parser) -> None:
    """Adds node and parameter."""
    node_option(parser)
    parser.add_argument("parameter", metavar="PARAMETER", help="a name of `gemelo param list NODE`")


def run_get(options: Options) -> ExitCode:
    """Prints a parameter's present value."""
    with connect() as session:
        value = parameter_of(session, options.node, options.parameter).value
    return print_value(value, options.json, lambda: written(value))


def run_describe(options: Options) -> ExitCode:
    """Prints all that is known of a parameter."""
    with connect() as session:
        parameter = parameter_of(session, options.node, options.parameter)
    return print_value(parameter, options.json, lambda: dump(parameter))


def set_options(parser: Parser) -> None:
    """Adds node, parameter, value and --save."""
    named_options(parser)
    parser.add_argument("--save", action="store_true", help="keep it beyond the end of the process")
    parser.add_argument("value", metavar="VALUE", help="in the parameter's own type and unit")


def run_set(options: Options) -> ExitCode:
    """Sets a parameter."""
    with connect() as session:
        print(set_parameter(session, options.node, options.parameter, options.value, options.save))
    return ExitCode.OK


def parameters_of(session: CommandSession, name: str) -> tuple[Parameter, ...]:
    """The declared parameters of a node."""
    from gemelo.libraries.runtime.endpoints import parameters_request  # 0.1 s, for a command that connects

    require_alive(session, name)
    return session.node.call(parameters_request(name), Empty(), timeout=TIMEOUT).parameters


class NodeParameters(NamedTuple):
    """The parameters of a node."""

    node: str
    parameters: tuple[Parameter, ...]


def parameter_table(found: Iterable[NodeParameters]) -> str:
    """The table for a person."""
    rows = [
        (
            name,
            each.name,
            each.type,
            written(each.value),
            written(each.default),
            range_of(each),
            translated(each.description),
        )
        for name, declared in found
        for each in declared
    ]
    return table(columns("node", "parameter", "type", "value", "default", "range", "about, with unit"), rows)


def written(value: ParameterValue) -> str:
    """A value as text."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def range_of(parameter: Parameter) -> str:
    """The allowed range as text."""
    low = "" if parameter.minimum is None else f"{parameter.minimum:g}"
    high = "" if parameter.maximum is None else f"{parameter.maximum:g}"
    return f"{low}..{high}" if low or high else "-"


def parameter_of(session: CommandSession, node: str, name: str) -> Parameter:
    """One parameter of a node; raises `CommandError` with the nearest name."""
    known = {parameter.name: parameter for parameter in parameters_of(session, node)}
    if name not in known:
        raise usage(because("cli.param.unknown", hint_of(name, known), node=node, name=name))
    return known[name]


def set_parameter(session: CommandSession, node: str, name: str, text: str, save: bool = False) -> str:
    """Sets a parameter and returns a line about it; the node itself refuses a value out of range."""
    parameter = parameter_of(session, node, name)
    return change_parameter(session, node, parameter, value_of(parameter, text), save)


def change_parameter(
    session: CommandSession, node: str, parameter: Parameter, value: ParameterValue, save: bool = False
) -> str:
    """Sets `parameter` of `node` to `value`, also for later starts if `save`, and returns a line about it."""
    from gemelo.libraries.runtime.endpoints import parameter_request  # 0.1 s, for a command that connects

    question = SetParameter(name=parameter.name, value=value, save=save)
    after = session.node.call(parameter_request(node), question, timeout=TIMEOUT)
    if save and not after.saved_in:  # an older node knows of no `save`
        raise CommandError(because("cli.param.not_saved", node=node, name=after.name, value=written(after.value)))
    change = f"{node} {after.name}: {written(parameter.value)} -> {written(after.value)}"
    return sentence(because("cli.param.saved", change=change, file=after.saved_in)) if save else change


def require_in_range(node: str, parameter: Parameter, value: ParameterValue) -> None:
    """Raises `CommandError` for a number out of the parameter's range."""
    low, high = parameter.minimum, parameter.maximum
    if isinstance(value, bool | str):
        return
    if (low is not None and value < low) or (high is not None and value > high):
        raise usage(because("cli.param.range", value=value, range=range_of(parameter), name=parameter.name, node=node))


def value_of(parameter: Parameter, text: str) -> ParameterValue:
    """`text` as the parameter's own type; raises `CommandError` if it is none."""
    kinds: dict[str, type] = {"bool": bool, "int": int, "float": float, "str": str}
    try:
        return msgspec.convert(text, kinds[parameter.type], strict=False)
    except (msgspec.ValidationError, KeyError) as error:
        raise usage(because("cli.param.type", text=text, type=str(parameter.type), name=parameter.name)) from error
