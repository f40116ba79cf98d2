"""A page of which a thread has died, as the one that sends a Stop, ends and is started again."""

from __future__ import annotations

import subprocess
import sys
import textwrap

from tests.runtime.support import ROOT

PROGRAM = """
import sys, threading, time
from gemelo.services.panel import main as panel

def run(*given):
    threading.Thread(target=lambda: [][1], name="stop").start()
    time.sleep(60.0)
    return 0

panel.run = run
sys.argv = ["gemelo-panel"]
panel.main()
"""


def test_a_thread_of_the_page_that_dies_ends_the_process_with_its_name() -> None:
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(PROGRAM)], cwd=ROOT, capture_output=True, text=True, timeout=50.0,
        check=False,
    )  # fmt: skip
    assert done.returncode == 1, done.stderr
    assert 'panel ERROR the thread "stop" has died, and with it this process' in done.stderr
    assert "IndexError" in done.stderr
