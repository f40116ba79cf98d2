"""Both brokers, each started once for a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.broker.running import BROKERS, VERSIONS, Client, RunningBroker


@pytest.fixture(scope="module", params=BROKERS)
def broker(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningBroker]:
    """An open one."""
    running = RunningBroker(request.param, tmp_path_factory.mktemp(request.param)).wait_ready()
    yield running
    running.stop()


@pytest.fixture(params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    """Of MQTT."""
    return str(request.param)


@pytest.fixture
def join(version: str) -> Iterator[Callable[..., Client]]:
    """Makes clients of that version, connected, and ends them."""
    with ExitStack() as all_of_them:

        def joined(broker: RunningBroker, name: str = "", **options: object) -> Client:
            client = Client(broker.port, name, version, **options)  # type: ignore[arg-type]
            all_of_them.callback(client.close)
            return client.connected()

        yield joined


@pytest.fixture
def topic(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """That no other test has."""
    return f"test/{tmp_path.parent.name}/{tmp_path.name}"
