"""The RAM that each build of the firmware takes: its variables on rv32, and what its start asks the heap for.

`python -m gemelo.firmware.platform.esp32.ram` prints the table of firmware/README.md. Wi-Fi, TCP/IP and TLS are extra.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

LAYER = Path(__file__).parent
CHIPS = ("esp32", "esp32s3", "esp32c3")
SIZE = "riscv64-unknown-elf-size"
MISSING = f"{SIZE} missing: sudo apt-get install gcc-riscv64-unknown-elf"

MOST_VARIABLES = 85_000  # [bytes] of any build; raise it only with a reason: TLS needs some 42 kB of what is left

STACK = re.compile(r"constexpr uint32_t k\w+Stack = (\d+)|config\.task\.stack_size = (\d+)")
MQTT_BUFFER = re.compile(r"config\.buffer\.(?:out_)?size = (\d+)")
UART_BUFFER = re.compile(r"constexpr int kBuffer = (\d+)")


class Ram(NamedTuple):
    """Of one build [bytes]."""

    variables: int  # .data and .bss of the layer; the core has none of its own
    stacks: int  # of our tasks and of esp-mqtt's
    uart: int  # both rings of the driver
    mqtt: int  # both buffers of esp-mqtt

    @property
    def together(self) -> int:
        return sum(self)


def measured(objects: Path) -> dict[str, Ram]:
    """By chip, of the objects that `check` has made in a folder of each."""
    return {chip: Ram(variables(objects / chip), *asked_of_the_heap()) for chip in CHIPS}


def variables(folder: Path) -> int:
    """[bytes] of .data and .bss of all objects in it; needs the tools for rv32."""
    rows = subprocess.run([SIZE, *sorted(folder.glob("*.o"))], capture_output=True, text=True, check=True).stdout
    return sum(int(data) + int(bss) for _, data, bss, *_ in map(str.split, rows.splitlines()[1:]))


def asked_of_the_heap() -> tuple[int, int, int]:
    """[bytes] of stacks, of the UART's rings and of MQTT's buffers, as the source has them."""
    main = LAYER / "main"
    tasks, mqtt, uart = ((main / name).read_text(encoding="utf-8") for name in ("tasks.h", "mqtt.cpp", "uart_port.cpp"))
    stacks = sum(int(one or other) for one, other in STACK.findall(tasks + mqtt))
    return stacks, 2 * sum(map(int, UART_BUFFER.findall(uart))), sum(map(int, MQTT_BUFFER.findall(mqtt)))


def table(found: dict[str, Ram]) -> str:
    """The rows as firmware/README.md has them."""
    return "\n".join(
        f"| {chip} | {' | '.join(f'{value:,}' for value in (*ram, ram.together))} |" for chip, ram in found.items()
    )


def main() -> None:
    """The command."""
    if shutil.which(SIZE) is None:
        sys.exit(MISSING)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([LAYER / "check", folder], check=True, capture_output=True)
        print(table(measured(Path(folder))))


if __name__ == "__main__":
    main()
