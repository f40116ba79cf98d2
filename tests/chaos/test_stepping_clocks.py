"""A clock that steps while its process runs: that process's wall clock alone, and never its monotonic one."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from gemelo.tools.chaos import clocks
from gemelo.tools.chaos.clocks import ClockError, SteppingClocks

TELLS = """
import sys, time
for line in sys.stdin:
    print(time.time(), time.monotonic(), flush=True)
"""  # its name is the program's second argument
MUCH = 1.0  # [s] more than any answer takes


class Program:
    """Says what its clocks are whenever it is asked."""

    def __init__(self, name: str, environment: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", TELLS, name], env=os.environ | environment, text=True, bufsize=1,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def ahead(self) -> tuple[float, float]:
        """[s] of its wall clock and of its monotonic one against ours."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write("now\n")
        wall, monotonic = (float(word) for word in self.process.stdout.readline().split())
        return wall - time.time(), monotonic - time.monotonic()

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


def test_a_clock_steps_while_its_process_runs_and_no_other_does(tmp_path):
    stepping = SteppingClocks(tmp_path, ["gemelo-one", "gemelo-two"])
    one, two, other = (Program(name, stepping.environment) for name in ("gemelo-one", "gemelo-two", "three"))
    try:
        for set_ahead, names, expected in (
            (100.0, ["gemelo-two"], (0.0, 100.0, 0.0)),
            (-3600.0, None, (-3600.0, -3600.0, 0.0)),
            (0.0, None, (0.0, 0.0, 0.0)),
        ):
            stepping.set_ahead(set_ahead, names)
            for program, wanted in zip((one, two, other), expected, strict=True):
                wall, monotonic = program.ahead()
                assert wall == pytest.approx(wanted, abs=MUCH)
                assert monotonic == pytest.approx(0.0, abs=MUCH)
    finally:
        for program in (one, two, other):
            program.close()


def test_without_a_compiler_the_package_that_has_one_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ClockError, match="apt-get install g"):
        clocks.shifted(tmp_path, {})
