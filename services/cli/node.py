"""`gemelo node`, `gemelo param` and `gemelo log`: the living nodes, their parameters and their log."""

from __future__ import annotations

import datetime

import msgspec

from schemas.system import Empty, LogLevel, LogRecord, NodeInfo, Parameter, Parameters, ParameterValue, SetParameter
from schemas.topics import LOG, Request
from services.cli.errors import CommandError, ExitCode, nearest, unknown, usage
from services.cli.messages import dump
from services.cli.parser import Options, Parser
from services.cli.session import Session, connect
from services.cli.text_table import table

TIMEOUT = 2.0  # [s]


def run_list(options: Options) -> ExitCode:
    """Prints the table of living nodes."""
    with connect() as session:
        print(listing(session))
    return ExitCode.OK


def node_option(parser: Parser) -> None:
    """Adds the node."""
    parser.add_argument("node", metavar="NODE", help="a name of `gemelo node list`")


def run_info(options: Options) -> ExitCode:
    """Prints one node."""
    with connect() as session:
        print(information(session, options.node), end="")
    return ExitCode.OK


def parameters_options(parser: Parser) -> None:
    """Adds the nodes."""
    parser.add_argument("nodes", metavar="NODE", nargs="*", help="all nodes, if none is named")


def run_parameters(options: Options) -> ExitCode:
    """Prints the table of parameters."""
    with connect() as session:
        print(parameter_table(session, options.nodes))
    return ExitCode.OK


def parameter_options(parser: Parser) -> None:
    """Adds node and parameter."""
    node_option(parser)
    parser.add_argument("parameter", metavar="PARAMETER", help="a name of `gemelo param list NODE`")


def run_get(options: Options) -> ExitCode:
    """Prints a parameter's present value."""
    with connect() as session:
        print(written(parameter_of(session, options.node, options.parameter).value))
    return ExitCode.OK


def run_describe(options: Options) -> ExitCode:
    """Prints all that is known of a parameter."""
    with connect() as session:
        print(dump(parameter_of(session, options.node, options.parameter)), end="")
    return ExitCode.OK


def set_options(parser: Parser) -> None:
    """Adds node, parameter and value."""
    parameter_options(parser)
    parser.add_argument("value", metavar="VALUE", help="in the parameter's own type and unit")


def run_set(options: Options) -> ExitCode:
    """Sets a parameter."""
    with connect() as session:
        print(set_parameter(session, options.node, options.parameter, options.value))
    return ExitCode.OK


def log_options(parser: Parser) -> None:
    """Adds level and node."""
    parser.add_argument("-l", "--level", default="info", help="debug, info, warning, error or fatal, and above")
    parser.add_argument("--node", metavar="NODE", help="only this node")


def run_log(options: Options) -> ExitCode:
    """Follows the log."""
    level = level_of(options.level)
    with connect() as session:
        return follow(session, level, options.node)


def information_of(session: Session, name: str) -> NodeInfo:
    """The keys that a node publishes, subscribes to and serves; raises `CommandError` if no such node is alive."""
    require_alive(session, name)
    return session.node.call(Request(f"@node/{name}/info", Empty, NodeInfo, name, ""), Empty(), timeout=TIMEOUT)


def require_alive(session: Session, name: str) -> None:
    """Raises `CommandError` with the nearest name if no such node is alive."""
    alive = living(session)
    if name not in alive:
        error = unknown("node", name, alive)
        raise CommandError(str(error), ExitCode.FAILED)


def living(session: Session) -> list[str]:
    """The nodes that are alive, other than this command's own."""
    return [name for name in sorted(session.node.alive()) if not name.startswith("cli-")]


def listing(session: Session) -> str:
    """The table of all living nodes; a clock is against this host's."""
    from services.runtime.errors import NoAnswer  # 0.1 s, for a command that connects
    from services.runtime.node_clock import ask_about

    rows = []
    for name in living(session):
        try:
            info, clock = ask_about(session.node, name, TIMEOUT)
        except NoAnswer:  # it hangs, or has just ended
            rows.append((name, session.arm.name, "-", "-", "-", "-", "does not answer", "-"))
            continue
        started = datetime.datetime.fromtimestamp(info.started / 1e9).strftime("%H:%M:%S")
        ready = "yes" if info.ready else info.problem or "no"
        about = (info.host, str(info.pid), info.version, started, ready)
        rows.append((name, info.robot, *about, "-" if clock is None else str(clock)))
    return table(("node", "robot", "host", "pid", "version", "started [local time]", "ready", "clock"), rows)


def information(session: Session, name: str) -> str:
    """One node as YAML."""
    return dump(information_of(session, name))


def parameters_of(session: Session, name: str) -> tuple[Parameter, ...]:
    """The declared parameters of a node."""
    require_alive(session, name)
    request = Request(f"@node/{name}/parameters/list", Empty, Parameters, name, "")
    return session.node.call(request, Empty(), timeout=TIMEOUT).parameters


def parameter_table(session: Session, names: list[str]) -> str:
    """A table of the parameters of the nodes named, of all nodes if `names` is empty."""
    rows = [
        (name, each.name, each.type, written(each.value), written(each.default), range_of(each), each.description)
        for name in names or living(session)
        for each in parameters_of(session, name)
    ]
    return table(("node", "parameter", "type", "value", "default", "range", "about, with unit"), rows)


def written(value: ParameterValue) -> str:
    """A value as text."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def range_of(parameter: Parameter) -> str:
    """The allowed range as text."""
    low = "" if parameter.minimum is None else f"{parameter.minimum:g}"
    high = "" if parameter.maximum is None else f"{parameter.maximum:g}"
    return f"{low}..{high}" if low or high else "-"


def parameter_of(session: Session, node: str, name: str) -> Parameter:
    """One parameter of a node; raises `CommandError` with the nearest name."""
    known = {parameter.name: parameter for parameter in parameters_of(session, node)}
    if name not in known:
        guess = nearest(name, known)
        hint = f'did you mean "{guess}"?' if guess else f"it has {', '.join(known) or 'none'}"
        raise usage(f'{node} has no parameter "{name}": {hint}')
    return known[name]


def set_parameter(session: Session, node: str, name: str, text: str) -> str:
    """Sets a parameter and returns a line about it; the node itself refuses a value out of range."""
    parameter = parameter_of(session, node, name)
    return change_parameter(session, node, parameter, value_of(parameter, text))


def change_parameter(session: Session, node: str, parameter: Parameter, value: ParameterValue) -> str:
    """Sets `parameter` of `node` to `value` and returns a line about it."""
    request = Request(f"@node/{node}/parameters/set", SetParameter, Parameter, node, "")
    after = session.node.call(request, SetParameter(name=parameter.name, value=value), timeout=TIMEOUT)
    return f"{node} {after.name}: {written(parameter.value)} -> {written(after.value)}"


def require_in_range(node: str, parameter: Parameter, value: ParameterValue) -> None:
    """Raises `CommandError` for a number out of the parameter's range."""
    low, high = parameter.minimum, parameter.maximum
    if isinstance(value, bool | str):
        return
    if (low is not None and value < low) or (high is not None and value > high):
        raise usage(f'{value:g} is not in {range_of(parameter)}, the range of parameter "{parameter.name}" of {node}')


def value_of(parameter: Parameter, text: str) -> ParameterValue:
    """`text` as the parameter's own type; raises `CommandError` if it is none."""
    kinds: dict[str, type] = {"bool": bool, "int": int, "float": float, "str": str}
    try:
        return msgspec.convert(text, kinds[parameter.type], strict=False)
    except (msgspec.ValidationError, KeyError) as error:
        raise usage(f'"{text}" is not a {parameter.type} for parameter "{parameter.name}"') from error


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


def follow(session: Session, level: LogLevel, node: str | None) -> ExitCode:
    """Prints records of `level` and above until Ctrl-C."""

    def on_record(record: LogRecord) -> None:
        if record.level >= level and node in (None, record.node):
            print(line_of(record), flush=True)

    session.node.subscribe(LOG, on_record)
    session.node.spin(lambda now: None, rate=20.0)
    return ExitCode.OK
