"""The nodes that control is about: who asks, and the key of a node's liveliness token."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from services.stepper_gateway.goals.rejections import invalid

# `@id/<principal>/<node>/<start [ns]>.<pid>.<host>` (services/runtime/bus/identity.py); nothing that a key
# gives a meaning. Recordings of before have no principal.
TOKEN = re.compile(
    r"@id/(?:[a-z0-9][a-z0-9_.-]{0,95}/)?([a-z0-9][a-z0-9_-]{0,63})/[0-9]{20}\.[0-9]{1,10}\.([A-Za-z0-9_-]{1,64})"
)


class MotionCaller(NamedTuple):
    """Who asks for a motion: a request names the session, a streamed target the node; empty where it is not known."""

    session: str = ""
    node: str = ""


@dataclass(frozen=True)
class ControlClient:
    """A node, by the key of its token and by its session."""

    key: str
    node: str
    host: str
    session: str

    def is_caller(self, caller: MotionCaller) -> bool:
        """True if `caller` names this node."""
        if caller.session:
            return caller.session == self.session
        return bool(caller.node) and caller.node == self.node


def client_of(key: str, session: str) -> ControlClient:
    """The node whose token is `key`; raises `GoalRejected` for a key that no node of this bus has."""
    found = TOKEN.fullmatch(key)
    if found is None:
        raise invalid(f'client "{key[:80]}" is not the key of a liveliness token: `gemelo control take` sends its own')
    if not session:
        raise invalid("the request does not say which session it comes from: use `gemelo control`, or its Python API")
    return ControlClient(key, found[1], found[2], session)
