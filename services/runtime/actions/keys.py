"""The keys of an action: goal, cancel and result requests, feedback and status topics."""

from __future__ import annotations

from schemas.actions import (
    CancelRequest,
    CancelResponse,
    GoalFeedback,
    GoalRequest,
    GoalResponse,
    GoalStatuses,
    ResultRequest,
    ResultResponse,
)
from schemas.message import Message
from schemas.topics import Action, Delivery, Request, Topic

AnyAction = Action[Message, Message, Message]


def goal_request(action: AnyAction) -> Request[GoalRequest, GoalResponse]:
    return Request(f"{action.key}/goal", GoalRequest, GoalResponse, action.server, "a goal to accept or refuse")


def cancel_request(action: AnyAction) -> Request[CancelRequest, CancelResponse]:
    return Request(
        f"{action.key}/cancel", CancelRequest, CancelResponse, action.server, "end a goal before its end", urgent=True
    )


def result_request(action: AnyAction) -> Request[ResultRequest, ResultResponse]:
    return Request(f"{action.key}/result", ResultRequest, ResultResponse, action.server, "how a goal ended")


def feedback_topic(action: AnyAction) -> Topic[GoalFeedback]:
    """EVERY: several goals share the key, and the newest of one must not push out another's."""
    return Topic(f"{action.key}/feedback", GoalFeedback, Delivery.EVERY, None, False, action.server, "how goals stand")


def status_topic(action: AnyAction) -> Topic[GoalStatuses]:
    """Latched, and repeated by the server's loop as its sign of life."""
    return Topic(f"{action.key}/status", GoalStatuses, Delivery.LATCHED, 4.0, False, action.server, "all goals")
