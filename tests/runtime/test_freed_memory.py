"""Freed memory goes back to the kernel while the process goes on."""

from __future__ import annotations

import subprocess
import sys

HOLES = """
import resource, time
from services.runtime.process.freed_memory import give_back_freed_memory

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()

kept = [bytes(20_000) for _ in range(2_000)]  # of the heap, not mapped each for itself
full = resident()
del kept[:-1:2]  # no hole is at the heap's end, from where it would be given back anyhow
assert resident() > 0.9 * full, "the holes were given back at once: nothing is tested"
give_back_freed_memory(every=0.01)
end = time.monotonic() + 20.0
while resident() > full - 10_000_000:
    assert time.monotonic() < end, f"{resident()} bytes are still resident of {full}"
    time.sleep(0.01)
"""


def test_holes_of_the_heap_are_given_back_while_the_process_goes_on() -> None:
    subprocess.run([sys.executable, "-c", HOLES], check=True, timeout=60.0)
