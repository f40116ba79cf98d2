"""Limits of the tool on a line or an arc, besides those of the joints; nonsense is refused by name."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo.schemas.planning import PlanCode, Refusal
from gemelo.services.planner.request.refusals import PlanRefused


@dataclass(frozen=True)
class ToolLimits:
    """Of the tool, 0 for none; and how the path is walked."""

    speed: float = 0.0  # [m/s]
    acceleration: float = 0.0  # [m/s^2]
    max_step: float = 0.0  # [m]
    jump: float = 0.0  # [rad] or [m]
    least_fraction: float = 1.0


def require_tool_limits(tool: ToolLimits) -> None:
    """Raises `PlanRefused` for what is no limit."""
    for name, value in (
        ("speed", tool.speed),
        ("acceleration", tool.acceleration),
        ("max_step", tool.max_step),
        ("jump_threshold", tool.jump),
    ):
        if not 0.0 <= value < math.inf:
            raise _no_limit(name, value, 0.0, f"{name} is {value:g}: it must be above 0, or 0 for none of its own")
    if not 0.0 <= tool.least_fraction <= 1.0:
        message = f"least_fraction is {tool.least_fraction:g}: it must be in [0, 1]"
        raise _no_limit("least_fraction", tool.least_fraction, 1.0, message)


def _no_limit(name: str, value: float, limit: float, message: str) -> PlanRefused:
    refusal = Refusal(
        check="tool limit",
        subject=name,
        value=value,
        limit=limit,
        message=message,
        remedy=f"leave {name} at its default",
    )
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)
