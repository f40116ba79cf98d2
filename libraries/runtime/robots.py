"""The robots that have living nodes on a router, whichever robot this process is for."""

from __future__ import annotations

from gemelo.libraries.runtime.bus.identity import ALIVE, addresses
from gemelo.schemas.deployment import RouterSection

TO_ANSWER = 1.0  # [s] for the router to list the liveliness tokens


def robots_on(router: RouterSection, node: str = "*") -> tuple[str, ...]:
    """The names of the robots of which `node` (or any node) is alive on `router`, sorted; none without an answer."""
    return tuple(sorted(robot for robot, nodes in nodes_on(router).items() if node == "*" or node in nodes))


def nodes_on(router: RouterSection) -> dict[str, frozenset[str]]:
    """The addresses of the living nodes on `router`, by robot; none if it cannot be asked.

    A session for one robot has its name as Zenoh's namespace and cannot see another's tokens, so this one has none.
    """
    import zenoh  # slow to load

    from gemelo.libraries.runtime.bus.zenoh_config import client_config

    try:
        with zenoh.open(client_config(router)) as session:
            replies = session.liveliness().get(f"*/{ALIVE}/*/*", timeout=TO_ANSWER)
            keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
    except zenoh.ZError:
        return {}
    found: dict[str, set[str]] = {}
    for robot, _, token in (key.partition("/") for key in keys):
        found.setdefault(robot, set()).update(addresses([token]))
    return {robot: frozenset(nodes) for robot, nodes in found.items() if nodes}
