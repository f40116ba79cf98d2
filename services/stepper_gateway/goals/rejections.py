"""The rejection of a goal: a code of the action and a reason that names the thing."""

from __future__ import annotations

from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.reasons import Reason


class GoalRejected(Exception):
    """A goal that is not carried out."""

    def __init__(self, code: FollowErrorCode, reason: Reason) -> None:
        super().__init__()
        self.code = code
        self.reason = reason

    def __str__(self) -> str:
        return str(self.reason)


def invalid(reason: Reason) -> GoalRejected:
    return GoalRejected(FollowErrorCode.INVALID_GOAL, reason)


def invalid_joints(reason: Reason) -> GoalRejected:
    return GoalRejected(FollowErrorCode.INVALID_JOINTS, reason)
