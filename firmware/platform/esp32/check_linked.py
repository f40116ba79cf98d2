"""Looks into a linked firmware.elf: what the tick runs must lie in IRAM, whatever the build has made of the fragments.

`python check_linked.py CHIP FIRMWARE.ELF`; PlatformIO runs it after each link and stops there if something is in flash.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

IRAM = {  # instruction RAM of each chip, from its technical reference manual
    "esp32": (0x4007_0000, 0x400A_0000),
    "esp32s3": (0x4037_0000, 0x403E_0000),
    "esp32c3": (0x4037_C000, 0x403E_0000),
}
# In mangled names: the interrupt, and the two objects of the core that it never leaves.
INTERRUPT, ENTRY = "Tick8on_alarm", "6gemelo7Stepper4tick"
INSIDE = (INTERRUPT, "6gemelo7Stepper", "6gemelo10InputWatch")
HEADER, SECTION, SYMBOL = struct.Struct("<16s2H5I6H"), struct.Struct("<10I"), struct.Struct("<3I2BH")
SYMTAB, FUNCTION = 2, 2


class NotLinkedRight(Exception):
    """The tick would stand still, or crash, while the flash is written."""


def functions(elf: bytes) -> dict[str, int]:
    """The address of each function of a 32-bit little-endian ELF file, by its mangled name."""
    header = HEADER.unpack_from(elf)
    if header[0][:6] != b"\x7fELF\x01\x01":
        raise NotLinkedRight("no 32-bit little-endian ELF file")
    start, size, count = header[6], header[11], header[12]
    sections = [SECTION.unpack_from(elf, start + size * index) for index in range(count)]
    found = {}
    for section in (each for each in sections if each[1] == SYMTAB):
        names = sections[section[6]][4]
        for at in range(section[4], section[4] + section[5], SYMBOL.size):
            name, address, _, info, _, _ = SYMBOL.unpack_from(elf, at)
            if info & 15 == FUNCTION:
                found[elf[names + name : elf.index(b"\0", names + name)].decode()] = address
    return found


def require_in_iram(chip: str, elf: bytes) -> int:
    """How many functions lie there; raises `NotLinkedRight` for one that lies elsewhere, or is missing."""
    low, high = IRAM[chip]
    addresses = functions(elf)
    for part in (INTERRUPT, ENTRY):
        if not any(part in name for name in addresses):
            raise NotLinkedRight(f"there is no function {part} in it: was it linked with gemelo_core?")
    wanted = {name: at for name, at in addresses.items() if any(part in name for part in INSIDE)}
    outside = [f"{name} at {at:#x}" for name, at in sorted(wanted.items()) if not low <= at < high]
    if outside:
        raise NotLinkedRight(
            f"not in the IRAM of {chip} ({low:#x} to {high:#x}): {', '.join(outside)}; the tick would stop while the "
            "flash is written: see gemelo_core/linker.lf"
        )
    return len(wanted)


def check(chip: str, path: str) -> int:
    """The exit code; says what was found."""
    try:
        count = require_in_iram(chip, Path(path).read_bytes())
    except NotLinkedRight as error:
        print(f"check_linked: {path}: {error}", file=sys.stderr)
        return 1
    print(f"check_linked: the tick is in IRAM: {count} functions")
    return 0


def hook_into_platformio() -> None:
    """As an extra script of platformio.ini, where `Import` is a function of SCons."""
    Import("env")  # type: ignore[name-defined]  # noqa: F821
    chip = env.BoardConfig().get("build.mcu")  # type: ignore[name-defined]  # noqa: F821
    env.AddPostAction(  # type: ignore[name-defined]  # noqa: F821
        "$BUILD_DIR/${PROGNAME}.elf", lambda target, source, env: check(chip, str(target[0]))
    )


if __name__ == "__main__":
    sys.exit(check(*sys.argv[1:]))
if "Import" in globals():
    hook_into_platformio()
