"""A router in a process of its own, and nodes on either bus."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.schemas.deployment import Deployment, PathsSection
from tests.runtime.support import Buses, RouterProcess


@pytest.fixture(scope="module")
def router(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RouterProcess]:
    process = RouterProcess(tmp_path_factory.mktemp("router"))
    yield process
    process.kill()


@pytest.fixture(params=["memory", "zenoh"])
def buses(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Buses]:
    """Every test of the contract runs on both."""
    if request.param == "memory":
        networks: dict[str, MemoryNetwork] = {}
        deployment = Deployment(paths=PathsSection(run=str(tmp_path / "run"), out=str(tmp_path / "out")))
        buses = Buses(lambda robot: MemoryBus(networks.setdefault(robot, MemoryNetwork())), deployment)
    else:
        router: RouterProcess = request.getfixturevalue("router")
        buses = Buses(lambda robot: ZenohBus(router.deployment.router, robot), router.deployment)
    yield buses
    buses.close()
