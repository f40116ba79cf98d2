"""The messages of any action: goal, cancel and result requests, and the feedback and status topics."""

from __future__ import annotations

from enum import IntEnum

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.reasons import Reason

NIL = msgspec.Raw(b"\xc0")  # msgpack nil


class GoalStatusCode(IntEnum):
    """The status of a goal; everything from SUCCEEDED on is terminal."""

    UNKNOWN = 0
    ACCEPTED = 1
    EXECUTING = 2
    CANCELING = 3
    SUCCEEDED = 4
    CANCELED = 5
    ABORTED = 6
    PREEMPTED = 7

    @property
    def is_terminal(self) -> bool:
        return self >= GoalStatusCode.SUCCEEDED


class GoalRequest(Message, frozen=True, kw_only=True):
    """A goal with the id its client chose; `goal` is the action's own goal message."""

    goal_id: str = ""
    client: str = ""  # key of its liveliness token
    goal: msgspec.Raw = NIL
    attached: bool = False  # cancel the goal when the client's token vanishes
    epoch: int = 0  # of the server that is to take it, as its `ResultResponse` says: void for another one; 0 for any


class GoalResponse(Message, frozen=True, kw_only=True):
    """Accepted, or refused with a code of the action and a reason that names the thing."""

    accepted: bool = False
    code: int = 0
    reason: str = ""
    why: Reason | None = None  # `reason` as data
    stamp: int = 0  # [ns] UNIX time of the decision


class CancelRequest(Message, frozen=True, kw_only=True):
    """Cancel one goal, or all of them where `goal_id` is empty."""

    goal_id: str = ""


class CancelResponse(Message, frozen=True, kw_only=True):
    """The goals that are being cancelled; `reason` says why there is none."""

    canceling: tuple[str, ...] = ()
    reason: str = ""
    why: Reason | None = None  # `reason` as data


class ResultRequest(Message, frozen=True, kw_only=True):
    """Ask for the result of a goal; answered when it ends or, with its status, after `wait`."""

    goal_id: str = ""
    wait: float = 0.0  # [s] how long the answer may be held back


class ResultResponse(Message, frozen=True, kw_only=True):
    """Status and, if terminal, the action's own result message."""

    status: GoalStatusCode = GoalStatusCode.UNKNOWN
    result: msgspec.Raw = NIL
    epoch: int = 0  # of the server, where it does not know the goal: random, drawn when it starts


class GoalFeedback(Message, frozen=True, kw_only=True):
    """The action's own feedback message for one goal."""

    goal_id: str = ""
    feedback: msgspec.Raw = NIL


class GoalStatus(Message, frozen=True, kw_only=True):
    """One goal's status."""

    goal_id: str = ""
    client: str = ""
    status: GoalStatusCode = GoalStatusCode.UNKNOWN


class GoalStatuses(Message, frozen=True, kw_only=True):
    """All goals that a server knows, oldest first."""

    stamp: int = 0  # [ns] UNIX time
    goals: tuple[GoalStatus, ...] = ()


class GoalEnd(Message, frozen=True, kw_only=True):
    """The end of a goal, with the action's own result message."""

    stamp: int = 0  # [ns] UNIX time
    goal_id: str = ""
    client: str = ""
    status: GoalStatusCode = GoalStatusCode.UNKNOWN
    result: msgspec.Raw = NIL
