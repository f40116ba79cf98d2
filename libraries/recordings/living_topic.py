"""A topic of which only its node has the message's class: read from what the node says of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import msgspec

from gemelo.schemas.message import Message
from gemelo.schemas.system import TopicInterface
from gemelo.schemas.topics import Delivery, Topic


@dataclass(frozen=True)
class LivingTopic(Topic[Any]):
    """A topic of which only its node has the message's class."""

    fields: dict[str, str] = field(default_factory=dict)  # their types by their names, as the class has them


def living_topic(told: TopicInterface) -> LivingTopic:
    """With a message whose fields take whatever comes."""
    fields = [(name, Any, None) for name, _ in told.fields]
    kind = msgspec.defstruct(told.message, fields, bases=(Message,), frozen=True, kw_only=True)
    delivery = Delivery(told.delivery) if told.delivery in {each.value for each in Delivery} else Delivery.EVERY
    return LivingTopic(
        told.key, kind, delivery, told.rate, told.recorded, told.writer, told.about, fields=dict(told.fields)
    )
