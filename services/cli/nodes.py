"""`gemelo node` and `gemelo param`: who is alive, and how they are set."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING

import msgspec

from schemas.system import Empty, NodeInfo, Parameter, Parameters, ParameterValue, SetParameter
from schemas.topics import Request
from services.cli.columns import table
from services.cli.exits import CommandError, ExitCode, usage
from services.cli.names import nearest, unknown
from services.cli.yaml import dump

if TYPE_CHECKING:
    from services.cli.session import Session

TIMEOUT = 2.0  # [s]


def information_of(session: Session, name: str) -> NodeInfo:
    """What the node says of itself."""
    require_alive(session, name)
    return session.node.call(Request(f"@node/{name}/info", Empty, NodeInfo, name, ""), Empty(), timeout=TIMEOUT)


def require_alive(session: Session, name: str) -> None:
    """Raises with the nearest name where no such node lives."""
    alive = living(session)
    if name not in alive:
        error = unknown("node", name, alive)
        raise CommandError(str(error), ExitCode.FAILED)


def living(session: Session) -> list[str]:
    """The nodes that are alive, other than this command's own."""
    return [name for name in sorted(session.node.alive()) if not name.startswith("cli-")]


def listing(session: Session) -> str:
    """All living nodes."""
    rows = []
    for name in living(session):
        info = information_of(session, name)
        started = datetime.datetime.fromtimestamp(info.started / 1e9).strftime("%H:%M:%S")
        rows.append((name, info.robot, info.host, str(info.pid), info.version, started))
    return table(("node", "robot", "host", "pid", "version", "started [local time]"), rows)


def information(session: Session, name: str) -> str:
    return dump(information_of(session, name))


def parameters_of(session: Session, name: str) -> tuple[Parameter, ...]:
    """The declared parameters of a node."""
    require_alive(session, name)
    request = Request(f"@node/{name}/parameters/list", Empty, Parameters, name, "")
    return session.node.call(request, Empty(), timeout=TIMEOUT).parameters


def parameter_table(session: Session, names: list[str]) -> str:
    """The parameters of the nodes named, of all where none is."""
    rows = [
        (name, each.name, each.type, written(each.value), written(each.default), range_of(each), each.description)
        for name in names or living(session)
        for each in parameters_of(session, name)
    ]
    return table(("node", "parameter", "type", "value", "default", "range", "about, with unit"), rows)


def written(value: ParameterValue) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def range_of(parameter: Parameter) -> str:
    low = "" if parameter.minimum is None else f"{parameter.minimum:g}"
    high = "" if parameter.maximum is None else f"{parameter.maximum:g}"
    return f"{low}..{high}" if low or high else "-"


def parameter_of(session: Session, node: str, name: str) -> Parameter:
    """One parameter, or the nearest name that there is."""
    known = {parameter.name: parameter for parameter in parameters_of(session, node)}
    if name not in known:
        guess = nearest(name, known)
        hint = f'did you mean "{guess}"?' if guess else f"it has {', '.join(known) or 'none'}"
        raise usage(f'{node} has no parameter "{name}": {hint}')
    return known[name]


def set_parameter(session: Session, node: str, name: str, text: str) -> str:
    """Sets a parameter; the node itself refuses what it cannot be."""
    parameter = parameter_of(session, node, name)
    value = value_of(parameter, text)
    request = Request(f"@node/{node}/parameters/set", SetParameter, Parameter, node, "")
    after = session.node.call(request, SetParameter(name=name, value=value), timeout=TIMEOUT)
    return f"{node} {after.name}: {written(parameter.value)} -> {written(after.value)}"


def value_of(parameter: Parameter, text: str) -> ParameterValue:
    """`text` in the parameter's own type."""
    kinds: dict[str, type] = {"bool": bool, "int": int, "float": float, "str": str}
    try:
        return msgspec.convert(text, kinds[parameter.type], strict=False)
    except (msgspec.ValidationError, KeyError) as error:
        raise usage(f'"{text}" is not a {parameter.type} for parameter "{parameter.name}"') from error
