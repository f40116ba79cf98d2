"""Limits of the tool on a line or an arc, besides those of the joints; nonsense is refused by name."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo.schemas.planning import PlanCode
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.request.refusals import PlanRefused, refusal_of


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
            raise _no_limit(name, value, 0.0, "plan.tool.limit")
    if not 0.0 <= tool.least_fraction <= 1.0:
        raise _no_limit("least_fraction", tool.least_fraction, 1.0, "plan.tool.least_fraction")


def _no_limit(name: str, value: float, limit: float, code: str) -> PlanRefused:
    why = because(code, remedy("leave_default", name=name), name=name, value=value)
    refusal = refusal_of(why, "tool limit", name, value, limit)
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)
