"""Clocks of processes that are not the system's: ahead, fast, or stepping while the process runs."""

from __future__ import annotations

import mmap
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import because

SOURCE = Path(__file__).with_name("shifted_clock.c")


class ClockError(ReasonedError):
    """There is no compiler for the library, or it does not compile; the text says the remedy."""


def shifted(folder: Path, clocks: Mapping[str, tuple[float, float]]) -> dict[str, str]:
    """The environment in which programs whose command line has one of the names have another clock.

    Each clock is ahead by [s], and runs faster by [s/s]. Raises `ClockError`.
    """
    library = folder / "clock.so"
    command = ["c++", "-x", "c", "-O2", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-ldl"]
    try:
        subprocess.run(command, check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise ClockError(because("chaos.clock.no_compiler")) from None
    except subprocess.CalledProcessError as error:
        raise ClockError(because("chaos.clock.not_compiled", file=SOURCE.name, error=error.stderr.strip())) from error
    table = ",".join(f"{name}={ahead}:{drift}" for name, (ahead, drift) in clocks.items())
    return {"LD_PRELOAD": str(library), "SHIFTED_CLOCKS": table}


class SteppingClocks:
    """The clocks of the programs with `names` in their command lines, which step where they are told to.

    `folder` must exist as long as they run. Raises `ClockError`.
    """

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        self.names = tuple(names)
        path = folder / "clock_steps"
        path.write_bytes(bytes(mmap.PAGESIZE))
        with path.open("r+b") as file:
            self._map = mmap.mmap(file.fileno(), mmap.PAGESIZE)
        self._steps = memoryview(self._map).cast("d")  # [s] ahead, by name
        self.environment = {**shifted(folder, dict.fromkeys(names, (0.0, 0.0))), "STEPPED_CLOCKS": str(path)}

    def set_ahead(self, seconds: float, names: Iterable[str] | None = None) -> None:
        """From now on the clocks of `names`, by default of all, are `seconds` [s] ahead of the system's."""
        for name in self.names if names is None else names:
            self._steps[self.names.index(name)] = seconds
