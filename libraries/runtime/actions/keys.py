"""The keys of an action: goal, cancel and result requests, feedback and status topics."""

from __future__ import annotations

from gemelo.schemas.actions import (
    CancelRequest,
    CancelResponse,
    GoalEnd,
    GoalFeedback,
    GoalRequest,
    GoalResponse,
    GoalStatuses,
    ResultRequest,
    ResultResponse,
)
from gemelo.schemas.message import Message
from gemelo.schemas.topics import Action, Delivery, Request, Topic

AnyAction = Action[Message, Message, Message]


def goal_request(action: AnyAction) -> Request[GoalRequest, GoalResponse]:
    return Request(f"{action.key}/goal", GoalRequest, GoalResponse, action.server, "a goal to accept or refuse")


def cancel_request(action: AnyAction) -> Request[CancelRequest, CancelResponse]:
    return Request(
        f"{action.key}/cancel", CancelRequest, CancelResponse, action.server, "end a goal before its end", urgent=True
    )


def result_request(action: AnyAction) -> Request[ResultRequest, ResultResponse]:
    """Not recorded: clients ask again and again, and `ended_topic` says the same once."""
    key = f"{action.key}/result"
    return Request(key, ResultRequest, ResultResponse, action.server, "how a goal ended", recorded=False)


def feedback_topic(action: AnyAction) -> Topic[GoalFeedback]:
    """EVERY: several goals share the key, and the newest of one must not push out another's."""
    return Topic(f"{action.key}/feedback", GoalFeedback, Delivery.EVERY, None, True, action.server, "how goals stand")


def status_topic(action: AnyAction) -> Topic[GoalStatuses]:
    """Latched, and repeated by the server's loop as its sign of life."""
    return Topic(f"{action.key}/status", GoalStatuses, Delivery.LATCHED, 4.0, True, action.server, "all goals")


def ended_topic(action: AnyAction) -> Topic[GoalEnd]:
    """The result of each goal, once, also of those that no client asks for."""
    return Topic(f"{action.key}/ended", GoalEnd, Delivery.EVERY, None, True, action.server, "how each goal ended")
