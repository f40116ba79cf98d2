"""Actions, as their users import them: long-running goals with feedback, a result and a cancel."""

from __future__ import annotations

from services.runtime.action_client import ActionClient
from services.runtime.action_server import ActionServer, GoalDecision, accept, refuse
from services.runtime.goal_handle import ActionOutcome, GoalHandle

__all__ = ["ActionClient", "ActionOutcome", "ActionServer", "GoalDecision", "GoalHandle", "accept", "refuse"]
