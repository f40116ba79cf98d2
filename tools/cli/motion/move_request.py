"""Options as arguments of `gemelo`, which makes the planner's request of them and knows what goes together.

A refusal names the option, by `word.option.*` of the catalogue where that is called otherwise than its argument.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeVar

from gemelo.api.arguments import Target, ToolGoal
from gemelo.api.errors import BadArgument
from gemelo.api.targets import ik_request, not_connected, request_of
from gemelo.schemas.planning import IkRequest, PlanRequest
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import usage
from gemelo.tools.cli.common.units import parse_joints
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


def request_from(options: Options, arm: ArmDescription) -> PlanRequest:
    """The request of `gemelo move`; raises `CommandError` naming options that do not go together."""
    return _asked(lambda: request_of(arm, Target(**given(options, arm, OF_MOVE)), not_connected))  # type: ignore[typeddict-item]


def ik_request_from(options: Options, arm: ArmDescription) -> IkRequest:
    """The request of `gemelo ik`; raises `CommandError` naming the option."""
    near = parse_joints(options.near, arm.joints) or None
    goal = ToolGoal(**given(options, arm, OF_IK))  # type: ignore[typeddict-item]
    return _asked(lambda: ik_request(arm, goal, not_connected, near, options.solutions, options.touching))


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
            raise usage(because("cli.move.execute_alone", option=_option(name)))


def _asked(request: Callable[[], Request]) -> Request:
    try:
        return request()
    except BadArgument as error:
        raise usage(error) from error


def _is_given(value: object) -> bool:
    """False for what argparse has where an option is not typed; a number is given, 0 among them."""
    return bool(value) or (type(value) in (int, float))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"
