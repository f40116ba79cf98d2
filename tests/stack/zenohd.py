"""A move through a whole stack whose router is zenohd: `python -m tests.stack.zenohd`, started by deploy/try_zenohd."""

from __future__ import annotations

import os
import subprocess
import tempfile
from pathlib import Path

import gemelo
from gemelo.libraries.runtime.bus.zenoh_bus import router_answers
from gemelo.tools.stack.stack import PROCESSES, Stack, free_ports
from tests.runtime.support import until, zenohd

LEFT_OUT = ("router", "viewer", "panel", "camera", "detector")
MOVES = 5


def main() -> None:
    """Prints what every move came to; raises where one did not succeed."""
    (port,) = free_ports(1)
    with tempfile.TemporaryDirectory() as folder:
        router = subprocess.Popen(zenohd(port, Path(folder)))
        try:
            assert until(lambda: router_answers("127.0.0.1", port), 60.0), "zenohd does not answer"
            move_through(port)
        finally:
            router.terminate()
            router.wait(60.0)


def move_through(port: int) -> None:
    """Starts all processes but the router, and moves there and back."""
    processes = [name for name in PROCESSES if name not in LEFT_OUT]
    with Stack(processes=processes, environment={"GEMELO_ROUTER_PORT": str(port)}) as stack:
        os.environ.update(stack.deployment)
        with gemelo.connect() as arm:
            arm.home()
            for number in range(MOVES):
                motion = arm.move(named="left" if number % 2 else "ready")
                error = max(map(abs, arm.step_errors.values()))
                print(f"move {number + 1}: {motion.status.name}, largest step error {error:.2f}")


if __name__ == "__main__":
    main()
