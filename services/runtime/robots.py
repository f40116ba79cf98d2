"""The robots that have living nodes on a router, whichever robot this process is for."""

from __future__ import annotations

from schemas.deployment import RouterSection
from services.runtime.bus.branches import branch_of
from services.runtime.bus.identity import ALIVE, addresses

TO_ANSWER = 1.0  # [s] for the router to list the liveliness tokens


def robots_on(router: RouterSection, node: str = "*") -> tuple[str, ...]:
    """The names of the robots of which `node` (or any node) is alive on `router`, sorted; none if it cannot be asked.

    A session for one robot has its name as Zenoh's namespace and cannot see another's tokens, so this one has none.
    """
    import zenoh  # slow to load

    from services.runtime.bus.zenoh_config import client_config

    tokens = f"{ALIVE}/{'*/*' if node == '*' else branch_of(node)}"
    try:
        with zenoh.open(client_config(router)) as session:
            replies = session.liveliness().get(f"*/{tokens}", timeout=TO_ANSWER)
            keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
    except zenoh.ZError:
        return ()
    return tuple(sorted({robot for robot, _, token in (key.partition("/") for key in keys) if any(addresses([token]))}))
