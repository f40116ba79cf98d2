"""The end of a twin that was streamed to: no process says on leaving that something of it has leaked."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import gemelo
from services.stack.stack import Stack
from tests.gemelo.conftest import BROKER, NEEDED, make_ready

pytestmark = pytest.mark.full


def test_after_a_streamed_session_no_process_tells_of_leaks(tmp_path: Path) -> None:
    stack = Stack(broker=BROKER, out=tmp_path, processes=NEEDED)
    with stack, pytest.MonkeyPatch.context() as patch:
        for name, value in stack.deployment.items():
            patch.setenv(name, value)
        stack.wait_ready(60.0)
        with gemelo.connect(timeout=10.0) as arm:
            make_ready(arm)
            arm.move(named="home")
            end = time.monotonic() + 20.0
            while abs(arm.joints["brazo_joint"] - 0.1) > 0.005:
                assert time.monotonic() < end
                arm.stream({"brazo_joint": 0.1})
        assert stack.stop() == 0
    said = {name: stack.logs(name) for name in NEEDED}
    assert all(said.values()), "the logs are kept"
    assert [name for name, log in said.items() if "nanobind" in log or "leaked" in log] == []
