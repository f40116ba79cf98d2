"""The same inputs give the same bits on every processor: which kernel of linear algebra a process works with."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

from gemelo.libraries.runtime.process.arithmetic import KERNEL, VARIABLE

CHOSEN = f"""
import ctypes, os
from pathlib import Path
import gemelo.services.planner, numpy
libraries = Path(numpy.__file__).parents[1] / "numpy.libs"
name = ctypes.CDLL(str(next(libraries.glob("*openblas*")))).scipy_openblas_get_corename64_
name.restype = ctypes.c_char_p
print(name().decode(), os.environ.get("{VARIABLE}"))
"""
HAS_IT = platform.machine() == "x86_64" and " avx2 " in Path("/proc/cpuinfo").read_text(encoding="utf-8")


def chosen(first: str = "", **environment: str) -> list[str]:
    """The kernel that a process works with in which the planner was imported before numpy, and the variable."""
    inherited = {name: value for name, value in os.environ.items() if name != VARIABLE}
    command = [sys.executable, "-c", first + CHOSEN]
    return subprocess.run(
        command, env=inherited | environment, capture_output=True, text=True, check=True
    ).stdout.split()


def test_the_planner_works_with_one_kernel_on_every_processor_that_has_it() -> None:
    assert chosen()[1] == (KERNEL if HAS_IT else "None")
    if HAS_IT:
        assert chosen()[0] == KERNEL


def test_a_kernel_that_somebody_has_chosen_stays() -> None:
    other = "Prescott" if platform.machine() == "x86_64" else "ARMV8"
    assert chosen(**{VARIABLE: other})[1] == other


def test_a_process_that_works_with_numpy_already_is_left_as_it_is() -> None:
    assert chosen("import numpy")[1] == "None"
