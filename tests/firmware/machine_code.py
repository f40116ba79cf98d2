"""The functions that a function of an object file may call, as read from its relocations."""

from __future__ import annotations

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

TOOL = "riscv64-unknown-elf-"
CALLS = ("R_RISCV_CALL", "R_RISCV_CALL_PLT", "R_RISCV_JAL")


@dataclass
class Function:
    """Its section, what it calls by name, and the mnemonics of its instructions."""

    section: str
    is_weak: bool = False
    calls: set[str] = field(default_factory=set)
    mnemonics: set[str] = field(default_factory=set)


def functions(objects: list[Path]) -> dict[str, Function]:
    """Every function that the objects define, by its linker name."""
    found: dict[str, Function] = {}
    for path in objects:
        weak = {line.split()[-1] for line in _run("nm", str(path)).splitlines() if " W " in line}
        _read(_run("objdump", "-dr", "--no-show-raw-insn", str(path)), weak, found)
    return found


def reached(code: dict[str, Function], start: str) -> tuple[set[str], set[str]]:
    """The functions of `code` that `start` may come to, itself included, and the names that are not in `code`."""
    inside: set[str] = set()
    outside: set[str] = set()
    waiting = [start]
    while waiting:
        name = waiting.pop()
        if name not in code:
            outside.add(name)
        elif name not in inside:
            inside.add(name)
            waiting += code[name].calls
    return inside, outside


def _read(listing: str, weak: set[str], found: dict[str, Function]) -> None:
    section, current = "", Function("")
    for line in listing.splitlines():
        if head := re.match(r"^Disassembly of section (.+):$", line):
            section = head[1]
        elif label := re.match(r"^[0-9a-f]+ <(.+)>:$", line):
            if not label[1].startswith(".L"):
                current = found.setdefault(label[1], Function(section, label[1] in weak))
        elif relocation := re.match(r"^\s+[0-9a-f]+: (R_RISCV_\w+)\s+([^\s+]+)", line):
            if relocation[1] in CALLS and not relocation[2].startswith(".L"):
                current.calls.add(relocation[2])
        elif row := re.match(r"^\s*[0-9a-f]+:\s+(\S+)\s*(?:[^<]*<([^>+]+)>)?", line):
            current.mnemonics.add(row[1])
            if row[2] and row[1].startswith("j") and not row[2].startswith(".L"):
                current.calls.add(row[2])


def _run(tool: str, *arguments: str) -> str:
    return subprocess.run([TOOL + tool, *arguments], check=True, capture_output=True, text=True).stdout
