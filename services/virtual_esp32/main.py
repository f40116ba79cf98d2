"""`gemelo-virtual-esp32`: the device's own firmware as a process, on real MQTT and in real time."""

from __future__ import annotations

import argparse
import logging
import os
import queue
import signal
import socket
import sys
from collections.abc import Sequence
from pathlib import Path

from gemelo.firmware.bindings.device import ConfigError
from gemelo.firmware.bindings.library import LibraryMissing
from gemelo.firmware.bindings.motor import MotorError
from gemelo.firmware.platform.host.board import Board
from gemelo.firmware.platform.host.link import Item, ShutdownRequested
from gemelo.firmware.platform.host.network import Network
from gemelo.firmware.platform.host.pty import SerialLine
from gemelo.firmware.platform.host.slot_record import VARIABLE, SlotRecord
from gemelo.firmware.platform.host.virtual_esp32 import VirtualEsp32
from gemelo.firmware.platform.host.virtual_sketch import VirtualSketch
from gemelo.firmware.platform.host.wires import Wires
from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt.access import device_access
from gemelo.libraries.runtime.deployment import DeploymentError, load_deployment, project_root
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.priority import raise_priority
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest, end_with_any_thread
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.deployment import Deployment, DeviceKind, Wire
from gemelo.schemas.reasons.catalogue import read_early
from gemelo.schemas.robot import Dialect

NAME = "virtual_esp32"
BEAT = 1.0  # [s] between two touches of the readiness file
log = logging.getLogger(NAME)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs until SIGTERM or SIGINT and returns 0; 1 with one sentence where it cannot start."""
    options = _parse(arguments)
    read_early()
    log.setLevel(options.log_level.upper())
    log.handlers = line_logger(NAME).handlers
    log.propagate = False
    try:
        run(load_deployment(options.config), options.serial)
    except (DeploymentError, AccessError, DescriptionError, ConfigError, MotorError, LibraryMissing) as error:
        log.error("%s", error)
        return 1
    return 0


def run(deployment: Deployment, has_line: bool = False) -> None:
    """Build the board of the deployment's robot and serve it, also over a serial line if that is asked for."""
    arm = load_arm(project_root() / deployment.robot)
    folder = project_root() / deployment.paths.run
    unwritten = UnwrittenFiles(log.warning)
    inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
    stop = ShutdownRequest()
    stop.on_set(lambda: inbox.put(ShutdownRequested()))
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    end_with_any_thread(log, lambda: stop.is_set)
    if deployment.device is DeviceKind.BOARD:
        return idle(inbox, Readiness(folder, NAME, unwritten))
    raise_priority()  # a board has its processor for itself
    access = device_access(deployment.mqtt, arm.device.name)
    if arm.device.dialect is Dialect.RA:
        return VirtualSketch(arm, access, inbox, Readiness(folder, NAME, unwritten)).run()
    network = Network(access, inbox, f"process {os.getpid()} on {socket.gethostname()}, {folder}")
    is_wired = deployment.wire is Wire.SERIAL or arm.device.dialect is Dialect.TEXT
    line = _serial_line(folder, inbox, unwritten) if has_line or is_wired else None
    board, wires = Board(arm, folder, NAME, unwritten), Wires(network, line)
    record = SlotRecord(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None
    VirtualEsp32(board, wires, inbox, Readiness(folder, NAME, unwritten), record).run()


def _serial_line(folder: Path, inbox: queue.SimpleQueue[Item], unwritten: UnwrittenFiles) -> SerialLine:
    line = SerialLine(folder / f"{NAME}.tty", inbox, unwritten)
    log.info("serial line at %s", line.path)
    return line


def idle(inbox: queue.SimpleQueue[Item], readiness: Readiness) -> None:
    """Stays ready and idle until shutdown: a real board drives the arm."""
    log.info("the deployment has a board: this virtual one stands aside")
    readiness.ready()
    while True:
        try:
            if isinstance(inbox.get(timeout=BEAT), ShutdownRequested):
                return readiness.not_ready()
        except queue.Empty:
            readiness.beat()


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gemelo-virtual-esp32", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="deployment file [deploy/local.toml]")
    parser.add_argument("--serial", action="store_true", help='have a serial line too, as wire = "serial" does')
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
