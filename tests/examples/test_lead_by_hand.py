"""The example that leads the tool by a hand controller, on both arms: events of an input device come through a pipe."""

from __future__ import annotations

import os
import re
import runpy
import struct
import sys
import time
from pathlib import Path

import pytest

import gemelo
from tests.simulated import found_by_connect, make_ready

EVENT = struct.Struct("llHHi")
ABSOLUTE, Z = 3, 2
TURNS = 3000  # of the example's loop, at most


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_the_tool_goes_where_the_axes_are_pushed(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe = tmp_path / "event7"
    os.mkfifo(pipe)
    with gemelo.simulate(name) as arm, found_by_connect(arm):
        make_ready(arm)
        arm.move(named="ready")
        begin = arm.pose().position
        device = os.open(pipe, os.O_RDWR)
        opened = [device]
        os.write(device, EVENT.pack(0, 0, ABSOLUTE, Z, -350))  # pulled: up is the tool's +z
        turns = iter(range(TURNS))
        real_sleep = time.sleep

        def sleep(seconds: float) -> None:
            real_sleep(0.0005)  # lets the example's reader run
            assert next(turns, None) is not None
            arm.sim.sleep(seconds)
            if opened and arm.pose().position[2] > begin[2] + 0.02:
                os.close(opened.pop())  # pulled out

        monkeypatch.setattr(time, "sleep", sleep)
        monkeypatch.setattr(sys, "argv", ["17_lead_by_hand.py", str(pipe), "0", "350"])
        runpy.run_path("examples/17_lead_by_hand.py", run_name="__main__")
        x, y, z = arm.pose().position
    output, errors = capsys.readouterr()
    assert errors == ""
    assert re.fullmatch(r"the tool is at( -?\d\.\d{3}){3} m", output.splitlines()[-1]), output
    assert z > begin[2] + 0.02
    assert (x, y) == pytest.approx(begin[:2], abs=0.003)
