"""Actions, as their users import them: long-running goals with feedback, a result and a cancel."""

from __future__ import annotations

from gemelo.libraries.runtime.actions.client import ActionClient
from gemelo.libraries.runtime.actions.goal_handle import ActionOutcome, GoalHandle
from gemelo.libraries.runtime.actions.server import ActionServer, GoalDecision, accept, refuse

__all__ = ["ActionClient", "ActionOutcome", "ActionServer", "GoalDecision", "GoalHandle", "accept", "refuse"]
