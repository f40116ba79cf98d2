"""Questions and answers as a topic: a request travels between two nodes only, so its server publishes both."""

from __future__ import annotations

from typing import Any

from gemelo.schemas.system import Exchange
from gemelo.schemas.topics import Delivery, Request, Topic

PREFIX = "@request/"


def exchange_topic(request: Request[Any, Any]) -> Topic[Exchange]:
    """What the request's server publishes: each question with its answer."""
    about = f"questions of {request.key}, each with its answer"
    return Topic(PREFIX + request.key, Exchange, Delivery.EVERY, None, request.recorded, request.server, about)
