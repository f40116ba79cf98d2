"""From the command line's words to a planning goal, and from a refusal back to words that could be typed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.planning import Goal, JointGoal, NamedGoal, PlanRequest, PoseGoal, Refusal
from services.cli.exits import usage
from services.cli.names import unknown
from services.cli.units import SHOWN, parse_joints

if TYPE_CHECKING:
    from services.arm.description import Arm


def goal_of(arm: Arm, to: Sequence[float] | None, joints: Sequence[str], named: str | None) -> Goal:
    """Exactly one of a tool position [m], joint assignments, and a named state."""
    given = [bool(to), bool(joints), named is not None]
    if sum(given) != 1:
        raise usage("say where to: one of --to X Y Z, --joints name=30deg ..., --named state")
    if to:
        return PoseGoal(position=tuple(to))
    if joints:
        values = parse_joints(joints, arm.joints)
        return JointGoal(name=tuple(values), position=tuple(values.values()))
    assert named is not None
    if named not in arm.state_names:
        raise unknown("named state", named, arm.state_names)
    return NamedGoal(name=named)


def request_of(goal: Goal, speed: float) -> PlanRequest:
    """A request at `speed`, the share of the velocity limits in (0, 1]."""
    if not 0.0 < speed <= 1.0:
        raise usage(f"--speed {speed:g} is not in (0, 1]")
    return PlanRequest(goal=goal, velocity_scaling=speed)


def refusal_text(refusal: Refusal, goal: Goal, arm: Arm) -> str:
    """One sentence: why not, and the nearest goal that can be reached, as it would be typed; else the remedy."""
    text = f"refused ({refusal.check}): {refusal.message}" if refusal.check else f"refused: {refusal.message}"
    if refusal.nearest:
        return f"{text}; nearest that can: {as_typed(goal, refusal.nearest, arm)}"
    return f"{text}; {refusal.remedy}" if refusal.remedy else text


def as_typed(goal: Goal, values: Sequence[float], arm: Arm) -> str:
    """`values`, in the form of `goal`, as options of `gemelo move`."""
    if isinstance(goal, PoseGoal):
        turn = f" {'--along' if goal.tool_axis else '--quaternion'} {_numbers(values[3:], 6)}" if values[3:] else ""
        return f"--to {_numbers(values[:3], 4)}{turn}"
    names = goal.name if isinstance(goal, JointGoal) and len(goal.name) == len(values) else arm.joint_names
    return "--joints " + " ".join(_assignment(arm, name, value) for name, value in zip(names, values, strict=False))


def _numbers(values: Sequence[float], digits: int) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def _assignment(arm: Arm, name: str, value: float) -> str:
    shown, factor = SHOWN[arm.joint(name).unit]
    return f"{name}={value * factor:.6g}{shown}"
