"""Options as arguments of `gemelo`, which makes the planner's request of them and knows what goes together."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeVar

from gemelo.api.arguments import Target, ToolGoal
from gemelo.api.errors import ArgumentRange, BadArgument
from gemelo.api.targets import ik_request, not_connected, request_of
from gemelo.schemas.planning import IkRequest, PlanRequest
from gemelo.tools.cli.common.errors import in_commands, usage
from gemelo.tools.cli.common.units import DEGREE, MILLIMETRE, parse_joints
from gemelo.tools.cli.parser import Options

if TYPE_CHECKING:
    from gemelo.libraries.arm.model.description import ArmDescription

Request = TypeVar("Request", PlanRequest, IkRequest)

OF_MOVE = {  # by argument, its option where that is called otherwise
    "position": "to", "orientation": "quaternion", "through": "arc", "least_fraction": "fraction",
    "allowed_time": "time",
}  # fmt: skip
OF_IK = OF_MOVE | {"position_tolerance": "tolerance", "orientation_tolerance": "turn_tolerance"}
ARGUMENTS = (*ToolGoal.__annotations__, *Target.__annotations__)
GOALS = ("to", "joints", "named")
SHOWN = {  # by the unit of an argument, the one that a person reads and its factor
    "m": ("mm", 1.0 / MILLIMETRE), "m/s": ("mm/s", 1.0 / MILLIMETRE), "m/s^2": ("mm/s2", 1.0 / MILLIMETRE),
    "rad or m": ("deg", 1.0 / DEGREE), "share": ("%", 100.0), "s": ("s", 1.0), "": ("", 1.0),
}  # fmt: skip


def request_from(options: Options, arm: ArmDescription) -> PlanRequest:
    """The request of `gemelo move`; raises `CommandError` naming options that do not go together."""
    return _asked(lambda: request_of(arm, Target(**given(options, arm, OF_MOVE)), not_connected), OF_MOVE)  # type: ignore[typeddict-item]


def ik_request_from(options: Options, arm: ArmDescription) -> IkRequest:
    """The request of `gemelo ik`; raises `CommandError` naming the option."""
    near = parse_joints(options.near, arm.joints) or None
    goal = ToolGoal(**given(options, arm, OF_IK))  # type: ignore[typeddict-item]
    return _asked(lambda: ik_request(arm, goal, not_connected, near, options.solutions, options.touching), OF_IK)


def given(options: Options, arm: ArmDescription, spelled: Mapping[str, str]) -> dict[str, object]:
    """The arguments that the options say, in SI units; `spelled` are the options by argument."""
    values = {name: getattr(options, spelled.get(name, name), None) for name in ARGUMENTS}
    if joints := values["joints"]:
        values["joints"] = parse_joints(joints, arm.joints)
    return {name: value for name, value in values.items() if _is_given(value)}


def require_alone(options: Options) -> None:
    """Raises `CommandError` for an option that goes with a goal only: a plan of before has its own path and speed."""
    names = [OF_MOVE.get(name, name) for name in ARGUMENTS]
    for name in (*names, "plan_only"):
        if name not in GOALS and _is_given(getattr(options, name, None)):
            raise usage(f"{_option(name)} does not go with --execute: the plan has its own path and speed")


def _asked(request: Callable[[], Request], spelled: Mapping[str, str]) -> Request:
    try:
        return request()
    except BadArgument as error:
        raise usage(in_options(error, spelled)) from error


def in_options(error: BadArgument, spelled: Mapping[str, str]) -> str:
    """What is wrong with an argument, said of its option in the units that people write."""
    options = {name: _option(spelled.get(name, name)) for name in ARGUMENTS}
    if error.out_of is not None:
        return _range_text(error.out_of, options[error.out_of.argument])
    return re.sub(r"\b([a-z_]+)=(?:True)?", lambda found: options.get(found[1], found[0]), in_commands(str(error)))


def _range_text(out_of: ArgumentRange, option: str) -> str:
    unit, factor = SHOWN[out_of.unit]
    value, least, most = (f"{factor * each:g}{unit}" for each in (out_of.value, out_of.least, out_of.most))
    if out_of.least > 0.0:
        return f"{option} {value} is not from {least} to {most}"
    return f"{option} {value} is not above 0" if out_of.value <= 0.0 else f"{option} {value} is more than {most}"


def _is_given(value: object) -> bool:
    """False for what argparse has where an option is not typed; a number is given, 0 among them."""
    return bool(value) or (type(value) in (int, float))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
