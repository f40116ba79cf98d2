"""The figure of joining a router: TLS with certificates of both ends and a router that asks for permission."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import locked_router
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.permissions import access_control
from gemelo.schemas.deployment import RouterSection
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile
from gemelo.tools.stack.stack import free_ports

ROUNDS = 40
ROBOT, ROLE, HOST = "rm1", "viewer", "127.0.0.1"
READY = 20.0  # [s] for the router


def handshake_ms() -> Figure:
    """Time [ms] from opening a session to its being joined, with TLS; the reference is the same without."""
    with tempfile.TemporaryDirectory(prefix="gemelo-handshake-") as name:
        folder = Path(name)
        plain_port, locked_port = free_ports(2)
        locked = _locked(folder, locked_port)
        with _router(folder / "plain", plain_port, {}):
            plain = joins(RouterSection(port=plain_port))
        with _router(folder / "tls", locked_port, {"GEMELO_ROUTER_CONFIGURATION": str(folder / "router.json5")}):
            took = joins(locked)
    reference = {"without TLS median": quantile(plain, 0.5), "without TLS p99": quantile(plain, 0.99)}
    note = f"{ROUNDS} sessions on loopback, one after the other: TCP, TLS with two certificates, Zenoh's own handshake"
    return of_samples(took, reference=reference, note=note)


def joins(router: RouterSection, rounds: int = ROUNDS) -> list[float]:
    """Times [ms] of so many sessions."""
    took = []
    for _ in range(rounds):
        started = time.perf_counter()
        bus = ZenohBus(router, ROBOT)
        took.append((time.perf_counter() - started) * 1e3)
        bus.close()
    return took


def _locked(folder: Path, port: int) -> RouterSection:
    """Writes certificates and the router's configuration; how a session joins it."""
    ca, router, role = (str(folder / f"{name}.pem") for name in ("ca", "router", ROLE))
    keys = {name: folder / f"{name}.key" for name in ("ca", "router", ROLE)}
    authority = Authority(Path(ca), keys["ca"])
    authority.sign([HOST], Path(router), keys["router"], 1)
    authority.sign_client(ROLE, Path(role), keys[ROLE], 1)
    settings = locked_router(HOST, port, ca, router, str(keys["router"]), access_control([ROBOT]))
    (folder / "router.json5").write_text(json.dumps(settings), encoding="utf-8")
    return RouterSection(port=port, tls=True, ca=ca, certificate=role, key=str(keys[ROLE]))


@contextmanager
def _router(folder: Path, port: int, more: Mapping[str, str]) -> Iterator[None]:
    """A router as a process of its own; raises `NotMeasured` where it does not start."""
    paths = {"GEMELO_PATHS_RUN": str(folder / "run"), "GEMELO_PATHS_OUT": str(folder / "out")}
    environment = os.environ | paths | {"GEMELO_ROUTER_PORT": str(port)} | dict(more)
    command = [sys.executable, "-m", "gemelo.services.router.main"]
    process = subprocess.Popen(command, cwd=project_root(), env=environment, stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + READY
        while not (folder / "run/router.ready").exists():
            if time.monotonic() > end or process.poll() is not None:
                raise NotMeasured(f"the router was not ready within {READY:g} s")
            time.sleep(0.02)
        yield
    finally:
        process.kill()
        process.wait()
