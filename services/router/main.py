"""`gemelo-router`: the Zenoh router of a local run, on loopback unless the deployment says otherwise."""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

import zenoh

from gemelo.libraries.runtime.bus.dead_links import end_dead_links
from gemelo.libraries.runtime.bus.zenoh_config import router_config
from gemelo.libraries.runtime.certificate_watch import CertificateWatch
from gemelo.libraries.runtime.deployment import DeploymentError, exposure, load_deployment
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.process.priority import step_ahead
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest, stop_on_signals
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.deployment import RouterSection

BEAT = 1.0  # [s]
_LOCATOR = re.compile(r"(tcp|tls)/(.+):(\d+)")
# Zenoh's own threads of the router, 2 without this. One that brings an answer to a client that does not read waits for
# up to LONGEST_BLOCK_US, and with it every link that the same thread serves: chosen as one for each process and script.
RECEIVING_THREADS = 16


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs until SIGTERM; 1 with one sentence where it cannot start."""
    parser = argparse.ArgumentParser(prog="gemelo-router", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    options = parser.parse_args(arguments)
    log = line_logger("router", options.log_level)
    stop = ShutdownRequest()
    os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {RECEIVING_THREADS}))")
    try:
        deployment = load_deployment(options.config)
        config, (host, port), is_locked = configured(deployment.router)
        if warning := exposure("router", host, is_locked, deployment.router.insecure):
            log.warning("%s", warning)
        with stop_on_signals(stop):
            require_free(host, port, "router", "listen_port" if deployment.router.listen_port else "port")
            with zenoh.open(config) as session:
                step_ahead()  # a stop passes through here
                watch = end_dead_links(session)
                locked = " with TLS, for certificates of its authority" if is_locked else ""
                log.info("listening on %s port %d%s", host, port, locked)
                certificate = CertificateWatch(shown(config), log.warning)
                readiness = Readiness(Path(deployment.paths.run), "router", UnwrittenFiles(log.warning))
                _beat_until(stop, readiness, certificate)
                del watch
    except (DeploymentError, PortTaken, zenoh.ZError) as error:
        log.error("%s", error)
        return 1
    return 0


def configured(section: RouterSection) -> tuple[zenoh.Config, tuple[str, int], bool]:
    """Zenoh's configuration, where it listens, and whether it asks everybody for a certificate and for permission.

    That is the file `configuration` where there is one, else an open router. Raises `DeploymentError`.
    """
    if not section.configuration:
        if section.tls:
            raise DeploymentError("router.tls needs router.configuration, which `gemelo deploy render` writes")
        return router_config(*section.listening), section.listening, False
    try:
        config = zenoh.Config.from_file(section.configuration)
        (locator,) = json.loads(config.get_json("listen/endpoints"))
        protocol, host, port = _LOCATOR.fullmatch(locator).groups()  # type: ignore[union-attr]
    except (zenoh.ZError, ValueError, AttributeError, TypeError) as error:
        raise DeploymentError(f"router.configuration: {section.configuration} cannot be used: {error}") from error
    is_asked = json.loads(config.get_json("transport/link/tls/enable_mtls")) is True
    permits = json.loads(config.get_json("access_control"))
    is_locked = is_asked and permits["enabled"] and permits["default_permission"] == "deny"
    return config, (host.strip("[]"), int(port)), protocol == "tls" and is_locked


def shown(config: zenoh.Config) -> str:
    """The file of the certificate that a router shows; empty without TLS."""
    return str(json.loads(config.get_json("transport/link/tls/listen_certificate")) or "")


def _beat_until(stop: ShutdownRequest, readiness: Readiness, certificate: CertificateWatch) -> None:
    readiness.ready()
    certificate.beat()
    try:
        while not stop.wait(BEAT):
            readiness.beat()
            certificate.beat()
    finally:
        readiness.not_ready()


if __name__ == "__main__":
    sys.exit(main())
