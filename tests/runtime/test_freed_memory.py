"""Freed memory goes back to the kernel while the process goes on."""

from __future__ import annotations

import subprocess
import sys

import pytest

HOLES = """
import resource, time
from gemelo.libraries.runtime.process.freed_memory import return_freed_memory

def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()

kept = [bytes(20_000) for _ in range(2_000)]  # of the heap, not mapped each for itself
full = resident()
del kept[:-1:2]  # no hole is at the heap's end, from where it would be given back anyhow
assert resident() > 0.9 * full, "the holes were given back at once: nothing is tested"
return_freed_memory(every=0.01)
end = time.monotonic() + 20.0
while resident() > full - 10_000_000:
    assert time.monotonic() < end, f"{resident()} bytes are still resident of {full}"
    time.sleep(0.01)
"""


def test_holes_of_the_heap_are_given_back_while_the_process_goes_on() -> None:
    subprocess.run([sys.executable, "-c", HOLES], check=True, timeout=60.0)


CIRCLES = """
import gc, time, weakref
from gemelo.libraries.runtime.process.freed_memory import return_freed_memory

class Circle:
    def __init__(self):
        self.own = self

gc.disable()  # so seldom does it come of itself where little is made
gone = weakref.ref(Circle())
assert gone() is not None, "the circle went by itself: nothing is tested"
return_freed_memory(every=0.01)
end = time.monotonic() + 20.0
while gone() is not None:
    assert time.monotonic() < end, "the circle is still there"
    time.sleep(0.01)
"""


def test_circles_that_nobody_holds_are_freed_while_the_process_goes_on() -> None:
    subprocess.run([sys.executable, "-c", CIRCLES], check=True, timeout=60.0)


HEAPS = """
import ctypes, sys, threading
from gemelo.libraries.runtime.process.freed_memory import return_freed_memory

if "shared" in sys.argv:
    return_freed_memory()
together = threading.Barrier(8)

def work():
    kept = [bytes(20_000) for _ in range(100)]
    together.wait()  # a thread that has ended leaves its heap to the next one

threads = [threading.Thread(target=work) for _ in range(8)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
library = ctypes.CDLL(None)
library.malloc_info(0, ctypes.c_void_p.in_dll(library, "stdout"))
library.fflush(None)
"""


@pytest.mark.parametrize("word", ["shared", ""])
def test_the_threads_of_a_process_share_one_heap(word: str) -> None:
    told = subprocess.run(
        [sys.executable, "-c", HEAPS, word], check=True, timeout=60.0, capture_output=True, text=True
    ).stdout
    assert (told.count("<heap ") == 1) is bool(word), told  # without it glibc makes them several
