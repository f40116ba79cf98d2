"""A planner's process as a thread, on a bus in memory."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection
from gemelo.services.planner.main import run


@contextmanager
def beside_a_planner(folder: Path, name: str = "asker", ends_within: float = 5.0) -> Iterator[Node]:
    """A node `name` beside a running planner, which must end within `ends_within` [s] of the end of the block."""
    network, stop = MemoryNetwork(), ShutdownRequest()
    deployment = Deployment(paths=PathsSection(run=str(folder)))

    def serve() -> None:
        with Node("planner", deployment, bus=MemoryBus(network), stop=stop) as node:
            run(node, deployment)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        with Node(name, deployment, bus=MemoryBus(network), stop=ShutdownRequest()) as node:
            yield node
    finally:
        stop.set()
        thread.join(ends_within)
        assert not thread.is_alive()
