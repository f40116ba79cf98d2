"""While a laptop without a certificate keeps everybody from joining, who is connected stops the arm all the same."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from tests.runtime.locks import HOST, Lock, LockedRouter
from tests.runtime.support import ROOT, until

KNOCKS = 30.0  # [1/s]
STOPS = 20
SLOWEST = 1.0  # [s] of one stop, on a machine that other tests load


@pytest.mark.full
def test_a_stop_over_a_session_that_is_open_is_answered_while_nobody_can_join(tmp_path: Path) -> None:
    lock = Lock(tmp_path / "lock", roles=("gateway", "operator.desk"))
    router = LockedRouter(tmp_path, lock)
    own = router.section("operator.desk")
    gateway, operator = ZenohBus(router.section("gateway"), "rm1"), ZenohBus(own, "rm1")
    shown = {"PORT": str(router.port), "TLS": "true", "CA": own.ca, "CERTIFICATE": own.certificate, "KEY": own.key}
    environ = os.environ | {f"GEMELO_ROUTER_{name}": value for name, value in shown.items()}
    script = [sys.executable, "-m", "tests.runtime.stranger"]
    gateway.serve("device/stop", lambda query: query.reply("Text", b"stopped"), urgent=True)
    assert operator.wait_served("device/stop", 5.0)
    joins = subprocess.Popen([*script, "join"], cwd=ROOT, env=environ, stdout=subprocess.PIPE, text=True)
    knocks = None
    try:
        assert joins.stdout is not None
        assert max(float(joins.stdout.readline()) for _ in range(5)) >= 0.0
        address = (HOST, str(router.port), str(KNOCKS))
        knocks = subprocess.Popen([*script, "garbage", *address], cwd=ROOT, stdout=subprocess.DEVNULL)
        assert any(float(joins.stdout.readline()) < 0.0 for _ in range(5))
        slowest = 0.0
        for _ in range(STOPS):
            answers: list[BusReply | None] = []
            began = time.monotonic()
            operator.ask("device/stop", "Text", b"", 2.0, answers.append, urgent=True)
            assert until(lambda answers=answers: answers)
            assert answers == [BusReply(True, "Text", b"stopped")]
            slowest = max(slowest, time.monotonic() - began)
        assert slowest < SLOWEST
        assert float(joins.stdout.readline()) < 0.0
    finally:
        for process in (joins, knocks):
            if process is not None:
                process.kill()
                process.communicate()
    operator.close()
    gateway.close()
    router.stop()
