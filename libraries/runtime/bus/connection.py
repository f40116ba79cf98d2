"""Opens the bus, waiting for the router where it is not there yet."""

from __future__ import annotations

import logging
import os
import socket
import time

from gemelo.libraries.credentials.private_files import require_private
from gemelo.libraries.runtime.bus.interface import Bus
from gemelo.libraries.runtime.deployment import when_silent
from gemelo.libraries.runtime.errors import BusError
from gemelo.libraries.runtime.process.readiness import tell_alive
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.reasons import because

RETRY_PERIOD = 0.1  # [s]
HANDSHAKE = 1.0  # [s] for the router to say why it refuses a certificate
SILENT_WAIT = 3.0  # [s] of waiting that are not worth a word: all processes start at once, on a slow machine too


def connect(router: RouterSection, robot: str, log: logging.Logger, stop: ShutdownRequest) -> Bus:
    """A session of the router; ends the process cleanly where it is asked to stop while waiting."""
    from gemelo.libraries.runtime.bus.zenoh_bus import BusNotOpen, ZenohBus, router_answers  # slow to load: zenoh

    require_certificate(router)
    is_said = False
    started = time.monotonic()
    while not stop.is_set:
        tell_alive()
        if router_answers(router.host, router.port):
            try:
                bus = ZenohBus(router, robot)
            except BusNotOpen as error:
                reason = f" ({refusal(router) or error})"
            else:
                if is_said:
                    log.info("the router is there")
                return bus
        else:
            reason = ""
        if not is_said and time.monotonic() - started > SILENT_WAIT:
            is_said = True
            known = reason or f": {when_silent(router.host)}"
            log.warning("waiting for the router at %s:%d%s", router.host, router.port, known)
        stop.wait(RETRY_PERIOD)
    raise SystemExit(0)


def await_router(router: RouterSection, log: logging.Logger, stop: ShutdownRequest) -> None:
    """Returns when something listens at the router's address; ends the process where it is asked to stop meanwhile."""
    from gemelo.libraries.runtime.bus.zenoh_bus import router_answers  # slow to load: zenoh

    started, is_said = time.monotonic(), False
    while not router_answers(router.host, router.port):
        if stop.is_set:
            raise SystemExit(0)
        if not is_said and time.monotonic() - started > SILENT_WAIT:
            is_said = True
            log.warning("waiting for the router at %s:%d: %s", router.host, router.port, when_silent(router.host))
        stop.wait(RETRY_PERIOD)


def require_certificate(router: RouterSection) -> None:
    """Returns if the section has what TLS needs; else raises `BusError` with the key of the deployment or the file."""
    if not router.tls:
        if router.certificate or router.key or router.ca:
            raise BusError(because("router.no_tls"))
        return
    for name in ("ca", "certificate", "key"):
        path = getattr(router, name)
        if not path:
            raise BusError(because("router.tls.file", key=name))
        if not os.access(path, os.R_OK):
            raise BusError(because("router.tls.unreadable", key=name, file=path))
    require_private(router.key)


def refusal(router: RouterSection) -> str:
    """Why TLS with the router fails, with the remedy; empty where TLS is not the reason."""
    if not router.tls:
        return ""
    import ssl  # slow to load, and only needed to say why the handshake fails

    try:
        context = ssl.create_default_context(cafile=router.ca)
        context.load_cert_chain(router.certificate, router.key)
        plain = socket.create_connection((router.host, router.port), HANDSHAKE)
        with plain, context.wrap_socket(plain, server_hostname=router.host) as link:
            link.recv(1)  # TLS 1.3 tells of a refused certificate only here
    except TimeoutError:
        return ""
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate is not one of {router.ca} for {router.host}: {error.verify_message}"
    except ssl.SSLError as error:
        said = str(error.reason).lower().replace("_", " ")
        if "expired" in said:
            return f"{router.certificate} has expired: `gemelo deploy keys` renews it"
        return f"the router does not take {router.certificate}, which its own authority must have signed: {said}"
    except OSError as error:
        return str(error)
    return ""
