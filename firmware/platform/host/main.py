"""`gemelo-virtual-esp32`: the device's own firmware as a process, on real MQTT and in real time."""

from __future__ import annotations

import argparse
import logging
import queue
import secrets
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from firmware.bindings.device import ConfigError, Device
from firmware.bindings.library import CoreMissing
from firmware.platform.host.link import DeviceLink, Item, Stop
from firmware.platform.host.memory import PoseMemory
from firmware.platform.host.virtual_esp32 import VirtualEsp32, offline_status
from schemas.deployment import Deployment
from schemas.device_config import DeviceConfig
from services.arm.description import Arm, load_arm
from services.arm.device_config import device_config, reference_steps
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
    except (DeploymentError, DescriptionError, ConfigError, CoreMissing) as error:
        log.error("%s", error)
        return 1
    return 0


def run(deployment: Deployment) -> None:
    """Build the device of the deployment's robot and serve it."""
    arm = load_arm(project_root() / deployment.robot)
    folder = project_root() / deployment.paths.run
    folder.mkdir(parents=True, exist_ok=True)
    config = device_config(arm)
    memory = PoseMemory(folder / f"{NAME}.json", config.name)
    device = _wake(config, arm, memory)
    inbox: queue.SimpleQueue[Item] = queue.SimpleQueue()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: inbox.put(Stop()))
    link = DeviceLink(deployment.mqtt.host, deployment.mqtt.port, config.name, offline_status(device), inbox)
    VirtualEsp32(device, link, inbox, memory, Readiness(folder, NAME)).run()


def _wake(config: DeviceConfig, arm: Arm, memory: PoseMemory) -> Device:
    awakening = memory.wake(reference_steps(arm))
    boot_id = secrets.randbelow((1 << 32) - 1) + 1
    device = Device(
        config,
        boot_id=boot_id,
        steps=awakening.steps,
        referenced=awakening.referenced,
        reset_cause=awakening.reset_cause,
    )
    where = "at " + ", ".join(f"{joint.name} {count}" for joint, count in zip(config.joints, device.steps, strict=True))
    log.info(
        "device %s, boot %08x (%s): %s",
        config.name,
        boot_id,
        awakening.reset_cause,
        where if awakening.referenced else "position unknown, `gemelo reference` declares it",
    )
    return device


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gemelo-virtual-esp32", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
