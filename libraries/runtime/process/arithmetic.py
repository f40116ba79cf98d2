"""One kernel of the library of linear algebra on every processor that has it: the same inputs give the same bits.

OpenBLAS chooses its kernels by the processor, and each rounds otherwise: a search that starts from another last bit may
find another path, and a recording of one machine would not replay on another.
"""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

KERNEL = "Haswell"  # of x86-64 with AVX2 and FMA, which those with AVX-512 have too
VARIABLE = "OPENBLAS_CORETYPE"  # read by the library when numpy is first imported


def use_one_kernel() -> None:
    """Chooses the kernel for this process and its children, unless one is chosen; has no effect once numpy is there."""
    if "numpy" not in sys.modules and VARIABLE not in os.environ and _has_it():
        os.environ[VARIABLE] = KERNEL


def _has_it() -> bool:
    if platform.machine() != "x86_64":
        return False
    try:
        flags = Path("/proc/cpuinfo").read_text(encoding="utf-8").partition("\nflags")[2].partition("\n")[0].split()
    except OSError:
        return False
    return {"avx2", "fma"} <= set(flags)
