"""`gemelo-broker`: the broker that the deployment names, on the port that it names."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path

from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt.access import gateway_access
from gemelo.libraries.mqtt.secure_folder import CERTIFICATE, require_made
from gemelo.libraries.runtime.certificate_watch import CertificateWatch
from gemelo.libraries.runtime.deployment import DeploymentError, exposure, load_deployment
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.process.priority import raise_priority
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.deployment import Broker, Deployment, MqttSection
from gemelo.schemas.reasons.catalogue import read_early
from gemelo.services.broker import embedded, mosquitto
from gemelo.services.broker.replacement import NotInstalled, become

BEAT = 1.0  # [s] of the readiness file
RENEWAL = (
    "`gemelo deploy keys` renews it, or `gemelo broker secure` where that made it; then start this process anew and, "
    "on another host, give it its folder before"
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs until SIGTERM; 1 with one sentence where it cannot start."""
    options = _parse(arguments)
    read_early()
    log = line_logger("broker", options.log_level)
    try:
        return run(load_deployment(options.config), log)
    except (DeploymentError, AccessError, PortTaken, NotInstalled) as error:
        log.error("%s", error)
        return 1


def run(deployment: Deployment, log: logging.Logger) -> int:
    """Becomes the broker; the readiness file is beaten once a second for as long as connections are accepted."""
    section = deployment.mqtt
    folder = Path(deployment.paths.run)
    readiness = Readiness(folder, "broker", UnwrittenFiles(log.warning))
    if section.broker is Broker.EXTERNAL:
        log.info("the deployment has its broker at %s port %d: this one stands aside", section.host, section.port)
        return stand_aside(readiness)
    if section.secure_folder:
        require_made(Path(section.secure_folder))
    gateway_access(section)  # raises where its users and TLS cannot be
    host, port = section.listening
    if warning := exposure("mqtt", host, bool(section.secure_folder), section.insecure):
        log.warning("%s", warning)
    require_free(host, port, "mqtt", "listen_port" if section.listen_port else "port")

    certificate = CertificateWatch(shown(section), log.warning, RENEWAL)

    lock = " with TLS" if section.secure_folder else ""
    answered = threading.Event()

    def beat() -> None:
        if not answered.is_set():
            answered.set()
            log.info("%s listens on %s port %d%s", section.broker, host, port, lock)
        readiness.ready()
        readiness.beat()
        certificate.beat()

    is_embedded = section.broker is Broker.EMBEDDED
    command = embedded.command(section) if is_embedded else mosquitto.command(section, folder)
    raise_priority()  # the device's heartbeats pass through here
    return become(command, section, beat, readiness.not_ready)


def shown(section: MqttSection) -> str:
    """The file of the certificate that a broker of ours shows; empty without TLS."""
    return str(Path(section.secure_folder) / CERTIFICATE) if section.secure_folder else ""


def stand_aside(readiness: Readiness) -> int:
    """Stays ready and idle until SIGTERM or SIGINT: what joins the broker says itself whether it can."""
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    readiness.ready()
    while not stop.wait(BEAT):
        readiness.beat()
    readiness.not_ready()
    return 0


def _parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="gemelo-broker", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
