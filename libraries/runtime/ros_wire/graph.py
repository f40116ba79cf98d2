"""The graph of ROS 2 on a router: every node and endpoint, by their liveliness tokens."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import zenoh

from gemelo.libraries.runtime.ros_wire.names import NODE, TOKENS, Entity, read_token
from gemelo.libraries.runtime.ros_wire.ros_node import opened

TO_ANSWER = 2.0  # [s] for the router


def entities(locator: str) -> tuple[Entity, ...]:
    """All that ROS nodes of any domain have declared on the router; raises `BusError` where it takes no session."""
    session = opened(locator)
    try:
        replies = session.liveliness().get(f"{TOKENS}/**", timeout=TO_ANSWER)
        found = [read_token(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None]
    except zenoh.ZError:
        found = []
    finally:
        session.close()  # type: ignore[no-untyped-call]
    return tuple(sorted(each for each in found if each is not None))


def nodes(graph: Iterable[Entity]) -> tuple[str, ...]:
    """The full names of all nodes."""
    return tuple(sorted({each.node for each in graph if each.kind == NODE}))


def others_hashes(graph: Iterable[Entity], node: str) -> Iterator[Entity]:
    """Endpoints at a name of the node's with its type and another hash, which neither send to it nor hear from it."""
    rows = [each for each in graph if each.kind != NODE]
    own = {(each.domain, each.name, each.type, each.hash) for each in rows if each.node == node}
    names = {key[:3] for key in own}
    for each in rows:
        key = (each.domain, each.name, each.type)
        if each.node != node and key in names and (*key, each.hash) not in own:
            yield each
