"""A virtual ESP32 on a pseudo-terminal in this process, images for it, and `gemelo device update` at the other end."""

from __future__ import annotations

import queue
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
from bed_firmware import free_port
from bench_firmware import command

from gemelo.firmware.bindings.library import LIBRARY
from gemelo.firmware.platform.host import virtual_esp32
from gemelo.firmware.platform.host.board import Board
from gemelo.firmware.platform.host.image import source_version, virtual_image
from gemelo.firmware.platform.host.link import Item, SerialBytes, ShutdownRequested
from gemelo.firmware.platform.host.network import Network
from gemelo.firmware.platform.host.pty import SerialLine
from gemelo.firmware.platform.host.virtual_esp32 import VirtualEsp32
from gemelo.firmware.platform.host.wires import Wires
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.runtime.firmware_update import UpdateAck
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.libraries.runtime.serial_frames import packet
from gemelo.libraries.runtime.signatures import make_key
from gemelo.schemas.device import DeviceCommandKind
from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.cli.device.provision import BAUD, open_line
from gemelo.tools.cli.device.update_transfer import SerialWire, UpdateStatus, UpdateWire, await_status
from gemelo.tools.cli.main import run

ROOT = Path(__file__).resolve().parents[2]
NEWER, OLDER = "1.0.9", "0.9.9"  # as long as the version that they replace in the library's bytes
NAME = "virtual_esp32"
SILENT = """
#include <stddef.h>
#include <stdint.h>
static char self;
void* gemelo_create() { return &self; }
int64_t gemelo_take() { return -1; }
int64_t gemelo_take_request() { return -1; }
"""  # and nothing else does or says anything


def core_of(version: str) -> bytes:
    """This core, but for what it calls its version."""
    old = b"\0" + source_version().encode() + b"\0"
    code = LIBRARY.read_bytes()
    assert code.count(old) == 1
    return code.replace(old, b"\0" + version.encode() + b"\0")


def silent_core(folder: Path) -> bytes:
    """A core that starts, and then says nothing to anybody."""
    source, built = folder / "silent.c", folder / "silent.so"
    names = {name.removeprefix("gemelo_") for name in exported(LIBRARY) if name.startswith("gemelo_")}
    rest = names - {"create", "take", "take_request"}
    source.write_text(SILENT + "".join(f"long gemelo_{name}() {{ return 0; }}\n" for name in sorted(rest)))
    subprocess.run(["cc", "-shared", "-fPIC", "-w", source, "-o", built], check=True)
    return built.read_bytes()


def exported(library: Path) -> list[str]:
    """The names of a library's functions."""
    done = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True)
    return [line.split()[-1] for line in done.stdout.splitlines()]


def an_image(code: bytes | None = None, version: str = NEWER) -> bytes:
    """An image of `code`, or of a core of that version: newer than what runs, if nothing is said."""
    return virtual_image(core_of(version) if code is None else code, version)


class UpdateBed:
    """One board with its files in `folder`; `trial` [s] is what a new firmware has to say status."""

    def __init__(self, folder: Path, monkeypatch: Any, trial: float = 20.0) -> None:
        monkeypatch.setattr(virtual_esp32, "TRIAL", trial)
        self.folder, self.key = folder, folder / "update.key"
        self.inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        make_key(self.key, self.key.with_suffix(".pub"))

    def start(self, with_key: bool = True, is_spoken_to: bool = True) -> None:
        """Switches the board on, with the slots that it has from before, and disarms it if it is spoken to."""
        board = Board(load_arm(ROOT / "urdf/rm1"), self.folder, NAME, UnwrittenFiles(print))
        board.provision({"update_key": self.key.with_suffix(".pub").read_text() if with_key else ""})
        line = SerialLine(self.folder / f"{NAME}.tty", self.inbox, UnwrittenFiles(print))
        network = Network(BrokerAccess("127.0.0.1", free_port()), self.inbox)
        readiness = Readiness(self.folder, NAME, UnwrittenFiles(print))
        process = VirtualEsp32(board, Wires(network, line), self.inbox, readiness)
        self._thread = threading.Thread(target=process.run)
        self._thread.start()
        self.port = str(line.path)
        if is_spoken_to:
            self.tell(command(DeviceCommandKind.DISARM, cmd_id=1, boot=0))
            with open_line(self.port, BAUD) as opened:
                assert await_status(SerialWire(opened), 20.0, lambda status: not status.armed) is not None

    def stop(self) -> None:
        """Switches it off."""
        if self._thread is not None:
            self.inbox.put(ShutdownRequested())
            self._thread.join(60.0)
            assert not self._thread.is_alive()
            self._thread = None

    def tell(self, frame: bytes) -> None:
        """A frame over its line."""
        self.inbox.put(SerialBytes(packet(frame), time.monotonic()))

    def file(self, image: bytes) -> str:
        """The path of a file with this image."""
        path = self.folder / "firmware.bin"
        path.write_bytes(image)
        return str(path)

    def update(self, image: bytes, *more: str) -> ExitCode:
        """`gemelo device update` over its line."""
        return run(["device", "update", self.file(image), "--serial", self.port, "--key", str(self.key), *more])

    @property
    def record(self) -> dict[str, object]:
        """What the boot loader knows."""
        return msgspec.json.decode((self.folder / f"{NAME}_ota.json").read_bytes(), type=dict[str, object])


class LossyWire:
    """A wire on which some frames are lost, doubled or damaged: `passes` says what arrives of the n-th."""

    def __init__(self, wire: UpdateWire, passes: Callable[[int, bytes], list[bytes]]) -> None:
        self._wire, self._passes = wire, passes
        self.sent = 0

    def send(self, frame: bytes) -> None:
        self.sent += 1
        for each in self._passes(self.sent, frame):
            self._wire.send(each)

    def knock(self) -> None:
        self._wire.knock()

    def take(self, patience: float) -> UpdateAck | UpdateStatus | None:
        return self._wire.take(patience)
