"""Espressif's esptool as a program of its own: what it writes, and what its failures mean.

It is no part of the product (its licence is the GPL): `make setup` installs it for development, and else a person does.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError
from gemelo.tools.cli.device.flash_parts import FirmwareBuild

BAUD = 460_800  # chosen: what every USB converter on such boards carries; esptool itself begins at 115200
LONGEST = 10.0  # [s] chosen: for it to end, once it has closed its output
CHIP = re.compile(r"(?:Chip type:\s*|Chip is |Detecting chip type\.\.\.\s*)(ESP32(?:-[A-Z]\d+)?)")
SIGNS = (  # of esptool 4 and 5, most telling first; what is found has the names of the reason's values
    (r"This chip is (?P<chip>\S+?),? not (?P<chips>\S+?)[.!]", "flash.other_chip"),
    (r"Permission denied", "flash.not_allowed"),
    (r"could not open", "flash.no_port"),
    (r"Wrong boot mode|Failed to connect|No serial data|Timed out waiting for packet", "flash.silent"),
    (r"(?:will not fit|larger than|exceeds).*flash", "flash.small"),
    (r"MD5 of file does not match|Hash of data|digest mismatch", "flash.differs"),
)


def find_esptool() -> list[str]:
    """How it is started: that beside this Python, else that of PATH; raises `CommandError` where there is none."""
    beside = Path(sys.executable).parent
    for name in ("esptool", "esptool.py"):
        found = shutil.which(name, path=str(beside)) or shutil.which(name)
        if found is not None:
            return [found]
    raise CommandError(because("flash.no_esptool"))


def chip_of(port: str) -> str:
    """The chip of the board at the port, as ESP32-C3; raises `CommandError` where it does not answer."""
    output = run_esptool(["--port", port, "--after", "no_reset", "chip_id"], port, lambda _: None)
    found = CHIP.findall(output)
    if not found:
        raise CommandError(because("flash.which_chip", port=port, error=last_line(output)))
    return str(found[-1])


def write(build: FirmwareBuild, port: str, baud: int, show: Callable[[str], None]) -> None:
    """Writes every part and compares it, then restarts the board; raises `CommandError` with the likely cause.

    `show` gets each line that esptool prints.
    """
    with tempfile.TemporaryDirectory(prefix="gemelo-flash-") as folder:
        files = []
        for part in build.parts:
            file = Path(folder) / part.name
            file.write_bytes(part.content)
            files += [f"{part.offset:#x}", str(file)]
        chip = build.chip.lower().replace("-", "")
        words = ["--chip", chip, "--port", port, "--baud", str(baud), "--after", "hard_reset", "write_flash", *files]
        run_esptool(words, port, show)


def run_esptool(words: Sequence[str], port: str, show: Callable[[str], None]) -> str:
    """Its output; raises `CommandError` where it fails, or does not end."""
    output = []
    with subprocess.Popen(
        [*find_esptool(), *words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                output.append(line)
                if "deprecated" not in line.lower():  # of the names that esptool 4 and 5 both take
                    show(line.rstrip())
            code = process.wait(LONGEST)
        finally:
            process.kill()
    text = "".join(output)
    if code != 0:
        raise CommandError(cause_of(text, port))
    return text


def cause_of(output: str, port: str) -> Reason:
    """What a failure most likely means, with the remedy."""
    for pattern, code in SIGNS:
        if found := re.search(pattern, output, re.IGNORECASE):
            return because(code, **(found.groupdict() or {"port": port}))
    return because("flash.failed", error=last_line(output))


def last_line(output: str) -> str:
    """The last one that says something."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    return lines[-1] if lines else "it says nothing"
