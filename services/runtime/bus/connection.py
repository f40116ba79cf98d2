"""Opens the bus, waiting for the router where it is not there yet."""

from __future__ import annotations

import logging
import time

from schemas.deployment import RouterSection
from services.runtime.bus.interface import Bus
from services.runtime.process.shutdown import ShutdownRequest

RETRY_PERIOD = 0.1  # [s]
SILENT_WAIT = 1.0  # [s] of waiting that are not worth a word: all processes start at once


def connect(router: RouterSection, robot: str, log: logging.Logger, stop: ShutdownRequest) -> Bus:
    """A session of the router; ends the process cleanly where it is asked to stop while waiting."""
    from services.runtime.bus.zenoh_bus import BusNotOpen, ZenohBus, router_answers

    is_said = False
    started = time.monotonic()
    while not stop.is_set:
        if router_answers(router.host, router.port):
            try:
                bus = ZenohBus(router.host, router.port, robot)
            except BusNotOpen as error:
                reason = f" ({error})"
            else:
                if is_said:
                    log.info("the router is there")
                return bus
        else:
            reason = ""
        if not is_said and time.monotonic() - started > SILENT_WAIT:
            is_said = True
            log.warning("waiting for the router at %s:%d%s; `make up` starts it", router.host, router.port, reason)
        stop.wait(RETRY_PERIOD)
    raise SystemExit(0)
