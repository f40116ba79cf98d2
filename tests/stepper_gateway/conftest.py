"""Brokers of both kinds with a virtual ESP32."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.stepper_gateway.processes import DEVICE, Processes


@pytest.fixture(params=["mosquitto", "embedded"])
def processes(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Processes]:
    with closing(Processes(request.param, tmp_path)) as found:
        found.start_broker()
        found.start(DEVICE)
        yield found
