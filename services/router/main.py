"""`gemelo-router`: the Zenoh router of a local run, on loopback unless the deployment says otherwise."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from gemelo.libraries.runtime.bus.router import RouterFailed, open_router, router_setup
from gemelo.libraries.runtime.certificate_watch import CertificateWatch
from gemelo.libraries.runtime.deployment import DeploymentError, exposure, load_deployment
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.process.priority import raise_priority
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest, stop_on_signals
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.reasons.catalogue import read_early

BEAT = 1.0  # [s]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs until SIGTERM; 1 with one sentence where it cannot start."""
    parser = argparse.ArgumentParser(prog="gemelo-router", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    options = parser.parse_args(arguments)
    read_early()
    log = line_logger("router", options.log_level)
    stop = ShutdownRequest()
    try:
        deployment = load_deployment(options.config)
        setup = router_setup(deployment.router)
        host, port = setup.listening
        if warning := exposure("router", host, setup.is_locked, deployment.router.insecure):
            log.warning("%s", warning)
        with stop_on_signals(stop):
            require_free(host, port, "router", "listen_port" if deployment.router.listen_port else "port")
            with open_router(setup):
                raise_priority()  # a stop passes through here
                locked = " with TLS, for certificates of its authority" if setup.is_locked else ""
                log.info("listening on %s port %d%s", host, port, locked)
                certificate = CertificateWatch(setup.certificate, log.warning)
                readiness = Readiness(Path(deployment.paths.run), "router", UnwrittenFiles(log.warning))
                _beat_until(stop, readiness, certificate)
    except (DeploymentError, PortTaken, RouterFailed) as error:
        log.error("%s", error)
        return 1
    return 0


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
