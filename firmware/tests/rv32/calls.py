"""The calls of the firmware core to the platform, and its step interrupt, as read from the machine code."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from gemelo.firmware.tests.rv32.toolchain import PREFIX, run

TICK = "_ZN6gemelo7Stepper4tickERKNS_6LevelsE"
OF_TICK = ("_ZN6gemelo7Stepper", "_ZNK6gemelo7Stepper", "_ZN6gemelo10InputWatch", "_ZNK6gemelo10InputWatch")
DIVISION = re.compile(r"^(div|rem)u?$")

Instruction = tuple[str, str]  # mnemonic, symbol that its operand points into or ""


def foreign_calls(core: Sequence[Path]) -> set[str]:
    """Functions that firmware/core uses and has not got."""
    asked = _symbols(run([PREFIX + "nm", "--undefined-only", *map(str, core)]))
    return asked - _symbols(run([PREFIX + "nm", "--defined-only", *map(str, core)]))


def faults_of_tick(program: Path) -> list[str]:
    """Sentences: the interrupt divides, calls through a pointer, or reaches code that is not the stepper's."""
    code = functions(run([PREFIX + "objdump", "--disassemble", "--no-show-raw-insn", str(program)]))
    faults = []
    for name in sorted(reached(code, TICK)):
        if not name.startswith(OF_TICK):
            faults.append(f"the tick calls {name}")
        elif any(mnemonic == "jalr" for mnemonic, _ in code[name]):
            faults.append(f"the tick calls through a pointer, in {name}")
        elif any(DIVISION.match(mnemonic) for mnemonic, _ in code[name]):
            faults.append(f"the tick divides, in {name}")
    return faults


def functions(listing: str) -> dict[str, list[Instruction]]:
    """Each function's instructions, by its linker name."""
    code: dict[str, list[Instruction]] = {}
    body: list[Instruction] = []
    for line in listing.splitlines():
        if head := re.match(r"^[0-9a-f]+ <(.+)>:$", line):
            body = code.setdefault(head[1], [])
        elif row := re.match(r"^\s*[0-9a-f]+:\s+(\S+)(.*)$", line):
            target = re.search(r"<([^>+]+)(\+0x[0-9a-f]+)?>", row[2])
            body.append((row[1], target[1] if target else ""))
    return code


def reached(code: dict[str, list[Instruction]], start: str) -> set[str]:
    """The function and all that it may come to, by calls and jumps."""
    seen: set[str] = set()
    waiting = [start]
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        waiting += _targets(code[name])
    return seen


def _targets(body: Iterable[Instruction]) -> list[str]:
    return [target for mnemonic, target in body if target and mnemonic.startswith(("j", "b"))]


def _symbols(listing: str) -> set[str]:
    return {line.split()[-1] for line in listing.splitlines() if " " in line}
