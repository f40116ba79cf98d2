"""The bridge's process as a thread, between a bus in memory and a router of ROS on loopback."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment, RosSection
from gemelo.services.ros_bridge.main import node_name, run
from tests.ros_bridge.ros_client import RosClient, ros_router
from tests.runtime.support import free_port


class Bridge(NamedTuple):
    """Both sides of a bridge that runs."""

    network: MemoryNetwork
    deployment: Deployment
    client: RosClient
    locator: str
    restart_router: Callable[[], None]

    def node(self, name: str) -> Node:
        """Another node of ours."""
        return Node(name, self.deployment, bus=MemoryBus(self.network))


@contextmanager
def running(folder: Path, cell: str = "", **section: object) -> Iterator[Bridge]:
    """`section`: of the deployment's [ros]."""
    port = free_port()
    with ExitStack() as routers, ExitStack() as clients:
        locator = routers.enter_context(ros_router(port))
        client = clients.enter_context(RosClient(locator, int(str(section.get("domain", 0)))))

        def restart() -> None:
            routers.close()
            routers.enter_context(ros_router(port))

        deployment = load_deployment(environ={"GEMELO_PATHS_RUN": str(folder / "run"), "GEMELO_CELL": cell})
        deployment = replace(deployment, ros=RosSection(router=locator, **section))
        network = MemoryNetwork()
        with Node(node_name(deployment), deployment, bus=MemoryBus(network)) as node:
            thread = threading.Thread(target=run, args=(node, deployment))
            thread.start()
            try:
                yield Bridge(network, deployment, client, locator, restart)
            finally:
                node.stop()
                thread.join(60.0)
