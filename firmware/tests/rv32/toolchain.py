"""The compilers and the emulator: found, or named with the remedy; sources in, programs and their output out."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).parent
CORE = HERE.parents[1] / "core"
PREFIX = "riscv64-unknown-elf-"
QEMU = "qemu-system-riscv32"
PACKAGES = {PREFIX + "g++": "gcc-riscv64-unknown-elf", PREFIX + "size": "binutils-riscv64-unknown-elf",
            QEMU: "qemu-system-misc", "c++": "g++"}  # fmt: skip
PATIENCE = 120.0  # [s]

LANGUAGE = ["-std=c++17", "-fno-exceptions", "-fno-rtti", "-Wall", "-Wextra", "-Werror", f"-I{CORE}"]
CHIP = ["-march=rv32imc", "-mabi=ilp32"]
# Loops stay loops: turned into memcpy and memset, the ones in virt.cpp would call themselves.
BARE = ["-Os", "-ffreestanding", "-fno-threadsafe-statics", "-fno-tree-loop-distribute-patterns", f"-I{HERE}/include"]


class Broken(Exception):
    """A tool ended with an error; the text is what it said."""


def missing() -> str:
    """A sentence with the remedy, or nothing."""
    absent = [tool for tool in PACKAGES if shutil.which(tool) is None]
    packages = " ".join(sorted({PACKAGES[tool] for tool in absent}))
    return f"{' and '.join(absent)} missing: sudo apt-get install {packages}" if absent else ""


def core_sources() -> list[Path]:
    return sorted(CORE.glob("*.cpp"))


def own_sources(*names: str) -> list[Path]:
    return [HERE / name for name in names]


def compile_for_chip(sources: Sequence[Path], folder: Path, joints: int) -> list[Path]:
    """Object files in `folder`, in the order of `sources`, of a core that can do `joints` joints."""
    folder.mkdir(exist_ok=True)
    objects = [folder / f"{source.stem}.o" for source in sources]
    options = [*CHIP, *LANGUAGE, *BARE, f"-DGEMELO_MAX_JOINTS={joints}"]
    _side_by_side(
        [[PREFIX + "g++", *options, "-c", str(s), "-o", str(o)] for s, o in zip(sources, objects, strict=True)]
    )
    return objects


def link_for_chip(objects: Sequence[Path], program: Path) -> Path:
    """An image for QEMU's virt machine."""
    layout = ["-nostdlib", "-Wl,--no-warn-rwx-segments", "-T", str(HERE / "virt.ld")]
    run([PREFIX + "g++", *CHIP, *layout, "-o", str(program), *map(str, objects), "-lgcc"])
    return program


def run_on_chip(program: Path) -> str:
    """What the program writes on its UART; -icount makes every run the same, one instruction a tick of the clock."""
    machine = ["-machine", "virt", "-bios", "none", "-icount", "shift=0", "-display", "none", "-monitor", "none"]
    return run([QEMU, *machine, "-serial", "stdio", "-kernel", str(program)])


def sizes(objects: Sequence[Path]) -> tuple[int, int]:
    """Bytes of code and constants, and of variables."""
    rows = [line.split() for line in run([PREFIX + "size", *map(str, objects)]).splitlines()[1:]]
    return sum(int(row[0]) for row in rows), sum(int(row[1]) + int(row[2]) for row in rows)


def compile_for_host(sources: Sequence[Path], folder: Path) -> Path:
    """A program of the same sources under the sanitizers."""
    folder.mkdir(exist_ok=True)
    program = folder / "program"
    objects = [folder / f"{source.stem}.o" for source in sources]
    options = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    compiler = os.environ.get("CXX", "c++").split()
    _side_by_side(
        [[*compiler, *LANGUAGE, *options, "-c", str(s), "-o", str(o)] for s, o in zip(sources, objects, strict=True)]
    )
    run([*compiler, *options, "-o", str(program), *map(str, objects)])
    return program


def run(command: Sequence[str]) -> str:
    """The command's output; raises Broken where it fails."""
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False, timeout=PATIENCE
        )
    except subprocess.TimeoutExpired as error:
        raise Broken(f"{command[0]} has not ended within {PATIENCE:g} s") from error
    if done.returncode:
        raise Broken(f"{' '.join(command)}\nended with {done.returncode}: {done.stderr or done.stdout[-2000:]}")
    return done.stdout


def _side_by_side(commands: Sequence[Sequence[str]]) -> None:
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run, commands))
