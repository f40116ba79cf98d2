"""`gemelo-virtual-esp32`: the device's own firmware as a process, on real MQTT and in real time."""

from __future__ import annotations

import argparse
import logging
import queue
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from firmware.bindings.device import ConfigError
from firmware.bindings.library import CoreMissing
from firmware.bindings.motor import MotorError
from firmware.platform.host.board import Board
from firmware.platform.host.link import BrokerAddress, Item, Stop
from firmware.platform.host.network import Network
from firmware.platform.host.virtual_esp32 import VirtualEsp32
from schemas.deployment import Deployment
from services.arm.description import load_arm
from services.arm.errors import DescriptionError
from services.runtime.deployment import DeploymentError, load_deployment, project_root
from services.runtime.logs import LEVELS, line_logger
from services.runtime.readiness import Readiness

NAME = "virtual_esp32"
log = logging.getLogger(NAME)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs until SIGTERM or SIGINT and returns 0; 1 with one sentence where it cannot start."""
    options = _parse(arguments)
    log.setLevel(options.log_level.upper())
    log.handlers = line_logger(NAME).handlers
    log.propagate = False
    try:
        run(load_deployment(options.config))
    except (DeploymentError, DescriptionError, ConfigError, MotorError, CoreMissing) as error:
        log.error("%s", error)
        return 1
    return 0


def run(deployment: Deployment) -> None:
    """Build the board of the deployment's robot and serve it."""
    arm = load_arm(project_root() / deployment.robot)
    folder = project_root() / deployment.paths.run
    folder.mkdir(parents=True, exist_ok=True)
    inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: inbox.put(Stop()))
    network = Network(BrokerAddress(deployment.mqtt.host, deployment.mqtt.port), inbox)
    VirtualEsp32(Board(arm, folder, NAME), network, inbox, Readiness(folder, NAME)).run()


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gemelo-virtual-esp32", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
