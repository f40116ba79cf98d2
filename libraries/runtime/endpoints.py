"""The endpoints of a node (publishers, subscriptions, servers, actions) and their statistics."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

import msgspec

from gemelo.libraries.runtime.bus.branches import branch_of
from gemelo.libraries.runtime.bus.identity import Identity
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.loop.loop import LoopFigures
from gemelo.libraries.runtime.requests.server import RequestServer
from gemelo.libraries.runtime.topics import Publisher, Subscription
from gemelo.schemas.system import (
    Empty,
    Interfaces,
    NodeInfo,
    NodeStatistics,
    Parameter,
    Parameters,
    SetParameter,
    TopicInterface,
    TopicStatistics,
)
from gemelo.schemas.topics import Request, Topic

if TYPE_CHECKING:
    from gemelo.libraries.runtime.actions.server import ActionServer


def info_request(node: str) -> Request[Empty, NodeInfo]:
    """`node` is an address (branches.py), as of all requests to a node."""
    return Request(f"@node/{branch_of(node)}/info", Empty, NodeInfo, node, "who this node is", recorded=False)


def interfaces_request(node: str) -> Request[Empty, Interfaces]:
    about = "the messages of its topics"
    return Request(f"@node/{branch_of(node)}/interfaces", Empty, Interfaces, node, about, recorded=False)


def parameters_request(node: str) -> Request[Empty, Parameters]:
    about = "all parameters of the node"
    return Request(f"@node/{branch_of(node)}/parameters/list", Empty, Parameters, node, about, recorded=False)


def parameter_request(node: str) -> Request[SetParameter, Parameter]:
    about = "a new value for one of them"
    return Request(f"@node/{branch_of(node)}/parameters/set", SetParameter, Parameter, node, about, recorded=False)


@dataclass
class NodeEndpoints:
    """All endpoints of one node."""

    publishers: dict[str, Publisher[Any]] = field(default_factory=dict)  # by key
    subscriptions: list[Subscription[Any]] = field(default_factory=list)
    servers: list[RequestServer[Any, Any]] = field(default_factory=list)
    actions: list[ActionServer[Any, Any, Any]] = field(default_factory=list)

    def add(self, subscription: Subscription[Any]) -> None:
        """Counts it until it is closed."""
        self.subscriptions.append(subscription)
        subscription.on_close = lambda: self.subscriptions.remove(subscription)

    def info(self, identity: Identity, robot: str, clock: Clock = SYSTEM) -> NodeInfo:
        """The node's identity and endpoints."""
        return NodeInfo(
            node=identity.name,
            robot=robot,
            host=clock.host(),
            pid=clock.process(),
            version=own_version(),
            started=identity.started,
            publishes=tuple(sorted(key for key in self.publishers if not key.startswith("@"))),
            subscribes=tuple(sorted({each.topic.key for each in self.subscriptions})),
            serves=tuple(sorted(each.request.key for each in self.servers if not each.request.key.startswith("@"))),
            actions=tuple(each.action.key for each in self.actions),
        )

    def interfaces(self) -> Interfaces:
        """The topics with their messages, one of each key."""
        spoken: list[Topic[Any]] = [each.topic for each in self.publishers.values()]
        topics = {each.key: each for each in [*(each.topic for each in self.subscriptions), *spoken]}
        return Interfaces(topics=tuple(_interface(topics[key]) for key in sorted(topics)))

    def statistics(self) -> tuple[TopicStatistics, ...]:
        """The counters of received, dropped and bad messages, by key."""
        hearers: list[Subscription[Any] | RequestServer[Any, Any]] = [*self.subscriptions, *self.servers]
        return tuple(each.statistics for each in hearers)

    def report_losses(self) -> None:
        """Warns once per reliable topic that has lost messages."""
        for each in self.subscriptions:
            each.report_losses()


def own_version() -> str:
    """Empty where the process has no descriptor left to read it."""
    try:
        return read_version()
    except (OSError, ImportError):
        return ""


@cache
def read_version() -> str:
    from importlib.metadata import version  # 20 ms that most nodes never need

    return version("gemelo")


def _interface(topic: Topic[Any]) -> TopicInterface:
    fields = [field.name for field in msgspec.structs.fields(topic.message)]
    types = {name: kind for base in reversed(topic.message.__mro__) for name, kind in _annotations(base).items()}
    return TopicInterface(
        key=topic.key,
        message=topic.message.__name__,
        fields=tuple((name, str(types.get(name, ""))) for name in fields),
        delivery=topic.delivery.value,
        rate=topic.rate,
        recorded=topic.recorded,
        writer=topic.writer,
        about=topic.about,
    )


def _annotations(kind: type) -> dict[str, Any]:
    """As written, where the module has postponed them; else the names of the types."""
    own = vars(kind).get("__annotations__", {})
    return {name: hint if isinstance(hint, str) else getattr(hint, "__name__", str(hint)) for name, hint in own.items()}


SHORTEST = 0.5  # [s] that a report must cover


class LoopStatistics:
    """Turns counters into one `NodeStatistics` a second."""

    def __init__(self, identity: Identity, clock: Clock = SYSTEM) -> None:
        self._identity, self._clock = identity, clock
        self._wall, self._cpu = clock.monotonic(), clock.cpu()

    def report(self, figures: LoopFigures, topics: tuple[TopicStatistics, ...]) -> NodeStatistics | None:
        """None where hardly any time has passed since the last one."""
        wall, cpu = self._clock.monotonic(), self._clock.cpu()
        elapsed = wall - self._wall
        if elapsed < SHORTEST:
            return None
        message = NodeStatistics(
            stamp=self._clock.unix(),
            node=self._identity.name,
            loop_rate=figures.steps / elapsed,
            loop_late_max=figures.late_max,
            cpu=(cpu - self._cpu) / elapsed,
            topics=topics,
            started=self._identity.started,
        )
        self._wall, self._cpu = wall, cpu
        return message
