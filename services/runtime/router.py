"""`gemelo-router`: the Zenoh router of a local run, on loopback unless the deployment says otherwise."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import zenoh

from services.runtime.bus.zenoh_config import router_config
from services.runtime.deployment import DeploymentError, load_deployment
from services.runtime.process.logs import LEVELS, line_logger
from services.runtime.process.ports import PortTaken, require_free
from services.runtime.process.readiness import Readiness
from services.runtime.process.shutdown import ShutdownRequest, stop_on_signals

BEAT = 1.0  # [s]
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
        section = deployment.router
        with stop_on_signals(stop):
            require_free(section.host, section.port, "router")
            with zenoh.open(router_config(section.host, section.port)):
                log.info("listening on %s port %d", section.host, section.port)
                _beat_until(stop, Readiness(Path(deployment.paths.run), "router"))
    except (DeploymentError, PortTaken, zenoh.ZError) as error:
        log.error("%s", error)
        return 1
    return 0


def _beat_until(stop: ShutdownRequest, readiness: Readiness) -> None:
    readiness.ready()
    try:
        while not stop.wait(BEAT):
            readiness.beat()
    finally:
        readiness.not_ready()


if __name__ == "__main__":
    sys.exit(main())
