"""The cost of the firmware core on the chip, and a comparison of its steps there with those on the host."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

from gemelo.firmware.tests.rv32 import calls, toolchain

JOINTS = 6
DEFAULT_JOINTS = 8  # that the core is built for unless told
PLAY = ("player.cpp", "stream.cpp")


def build(folder: Path) -> tuple[list[Path], list[Path]]:
    """The core's objects, and those of a play on QEMU's machine."""
    core = toolchain.compile_for_chip(toolchain.core_sources(), folder / "core", JOINTS)
    play = toolchain.own_sources("start.S", "virt.cpp", *PLAY)
    return core, toolchain.compile_for_chip(play, folder / "play", JOINTS)


def cost(core: list[Path], play: list[Path], folder: Path) -> dict[str, float]:
    """Every figure that gates.toml can bound, by the name it has there, and some more: [bytes] or [instructions]."""
    text, statics = toolchain.sizes(core)
    figures: dict[str, float] = {"core_text_bytes": text}
    for joints, name in ((JOINTS, "core_ram_bytes"), (DEFAULT_JOINTS, f"core_ram_bytes_{DEFAULT_JOINTS}")):
        ram = toolchain.compile_for_chip(toolchain.own_sources("ram.cpp"), folder / f"ram{joints}", joints)
        figures[name] = statics + toolchain.sizes(ram)[1]
    count = toolchain.compile_for_chip(toolchain.own_sources("count.cpp"), folder / "count", JOINTS)
    output = toolchain.run_on_chip(toolchain.link_for_chip([*core, *play, *count], folder / "count.elf"))
    return figures | instructions(output)


def faults(core: list[Path], allowed: list[str], folder: Path) -> list[str]:
    """Sentences on what the machine code does that it must not; after cost()."""
    foreign = sorted(calls.foreign_calls(core) - set(allowed))
    asks = [f"the core calls {name}, which gates.toml does not allow" for name in foreign]
    return asks + calls.faults_of_tick(folder / "count.elf")


def instructions(output: str) -> dict[str, float]:
    """`tick_6_mean` and so on from what count.cpp writes: name, joints, sum, count, median, p99, most."""
    figures: dict[str, float] = {}
    for line in output.splitlines():
        name, joints, *numbers = line.split()
        total, count, median, p99, most = map(int, numbers)
        row = {"mean": round(total / count, 1), "median": median, "p99": p99, "max": most}
        figures |= {f"{name}_{joints}_{what}": value for what, value in row.items()}
    return figures


def traces(core: list[Path], play: list[Path], folder: Path) -> tuple[str, str]:
    """The golden trace of the host and of the chip."""
    sources = [*toolchain.core_sources(), *toolchain.own_sources(*PLAY, "golden.cpp", "host.cpp")]
    host = toolchain.run([str(toolchain.compile_for_host(sources, folder / "host"))])
    golden = toolchain.compile_for_chip(toolchain.own_sources("golden.cpp"), folder / "golden", JOINTS)
    return host, toolchain.run_on_chip(toolchain.link_for_chip([*core, *play, *golden], folder / "golden.elf"))


def differences(host: str, chip: str) -> list[str]:
    """A sentence on where the traces part, if they do."""
    if not host:
        return ["the golden trace is empty"]
    for number, (left, right) in enumerate(zip_longest(host.splitlines(), chip.splitlines()), 1):
        if left != right:
            return [f"golden traces part in line {number}:\n  host  {left}\n  rv32  {right}"]
    return []
