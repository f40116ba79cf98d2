"""The nodes that control is about: who asks, and the key of a node's liveliness token."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from gemelo.schemas.reasons import because
from gemelo.schemas.roles import ROLE_OF_NODE
from gemelo.services.stepper_gateway.goals.rejections import invalid

LOCAL = "local"  # the principal of a node without a certificate

# `@id/<principal>/<node>/<start [ns]>.<pid>.<host>` (libraries/runtime/bus/identity.py); nothing that a key
# gives a meaning. Recordings of before have no principal.
TOKEN = re.compile(
    r"@id/(?:([a-z0-9][a-z0-9_.-]{0,95})/)?([a-z0-9][a-z0-9_-]{0,63})/[0-9]{20}\.[0-9]{1,10}\.([A-Za-z0-9_-]{1,64})"
)


class MotionCaller(NamedTuple):
    """Who asks for a motion: a request names the session, a streamed target the node by its address in the key of the
    target; empty where it is not known."""

    session: str = ""
    node: str = ""


@dataclass(frozen=True)
class ControlClient:
    """A node, by the key of its token and by its session."""

    key: str
    node: str
    host: str
    session: str
    address: str  # of the node (libraries/runtime/bus/branches.py)

    def is_caller(self, caller: MotionCaller) -> bool:
        """True if `caller` names this node."""
        if caller.session:
            return caller.session == self.session
        return bool(caller.node) and caller.node == self.address


def client_of(key: str, session: str) -> ControlClient:
    """The node whose token is `key`; raises `GoalRejected` for a key that no node of this bus has."""
    found = TOKEN.fullmatch(key)
    if found is None:
        raise invalid(because("control.client.no_token", client=key[:80]))
    if not session:
        raise invalid(because("control.client.no_session"))
    principal, node, host = found[1] or LOCAL, found[2], found[3]
    is_plain = principal == LOCAL or ROLE_OF_NODE.get(node) == principal
    return ControlClient(key, node, host, session, node if is_plain else f"{principal}/{node}")
