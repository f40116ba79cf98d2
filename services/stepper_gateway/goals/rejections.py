"""The rejection of a goal: a code of the action and a sentence that names the thing."""

from __future__ import annotations

from gemelo.schemas.motion import FollowErrorCode


class GoalRejected(Exception):
    """A goal that is not carried out."""

    def __init__(self, code: FollowErrorCode, reason: str) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason


def invalid(reason: str) -> GoalRejected:
    return GoalRejected(FollowErrorCode.INVALID_GOAL, reason)


def invalid_joints(reason: str) -> GoalRejected:
    return GoalRejected(FollowErrorCode.INVALID_JOINTS, reason)
