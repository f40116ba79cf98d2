"""The limits of new connections: the syntax by nft itself, and a laptop without a certificate that knocks in vain."""

from __future__ import annotations

import itertools
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.libraries.runtime.bus.zenoh_config import locked_router
from gemelo.tools.hosts import firewall
from gemelo.tools.hosts.install import commands
from gemelo.tools.hosts.render import rendered
from tests.hosts.sites import EXAMPLE, site
from tests.optional import need, need_root
from tests.runtime.locks import Lock
from tests.runtime.support import ROOT, until

ROUTER, DESK, STRANGER = "10.79.0.1", "10.79.0.2", "10.79.0.9"
KNOCKS = 30.0  # [1/s] of the stranger


def nft(*arguments: str, text: str) -> subprocess.CompletedProcess[str]:
    inside = ["unshare", "--net", "nft", *arguments, "-f", "-"]
    return subprocess.run(inside, input=text, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("address", ["10.0.0.12", "fd00::12", "brain.lab"])
def test_what_is_rendered_is_what_nft_reads_and_reads_again(tmp_path: Path, address: str) -> None:
    need_root("tests/hosts/test_firewall.py")
    need("nft")
    lab = site(tmp_path, '"10.0.0.12"', f'"{address}"')
    text = rendered(lab, "brain")[firewall.FILE]
    done = nft("--check", text=text + text)
    assert (done.returncode, done.stderr) == (0, "")
    assert (address in text) == (address != "brain.lab")


def test_only_hosts_of_router_and_broker_have_it_and_install_loads_it(tmp_path: Path) -> None:
    lab = site(tmp_path)
    for host in lab.hosts:
        files = rendered(lab, host)
        is_open = bool(firewall.ports(lab, host))
        assert (firewall.FILE in files) == (f"systemd/{firewall.UNIT_NAME}" in files) == is_open
        for folder in ("systemd", "keys"):
            (tmp_path / host / folder).mkdir(parents=True)
        run = " ".join(itertools.chain(*commands(lab, host, tmp_path / host)))
        assert ("systemctl restart gemelo-firewall.service" in run) == ("command -v nft" in run) == is_open
    assert EXAMPLE.is_file()


class Wire:
    """Two namespaces with a wire between them: the router's host, and one with the desk's and a stranger's address."""

    def __init__(self) -> None:
        self.router, self.others = (f"gemelo-{os.getpid()}-{name}" for name in ("r", "o"))
        for name in (self.router, self.others):
            self.ip("netns", "add", name)
            self.ip("-n", name, "link", "set", "lo", "up")
        self.ip("link", "add", "w", "netns", self.router, "type", "veth", "peer", "w", "netns", self.others)
        for name, addresses in ((self.router, (ROUTER,)), (self.others, (DESK, STRANGER))):
            for address in addresses:
                self.ip("-n", name, "addr", "add", f"{address}/24", "dev", "w")
            self.ip("-n", name, "link", "set", "w", "up")

    def ip(self, *words: str) -> None:
        subprocess.run(["ip", *words], check=True, capture_output=True)

    def start(self, where: str, *words: str, **environ: str) -> subprocess.Popen[str]:
        inside = ["ip", "netns", "exec", where, *words]
        return subprocess.Popen(inside, cwd=ROOT, env=os.environ | environ, stdout=subprocess.PIPE, text=True)

    def close(self) -> None:
        for name in (self.router, self.others):
            self.ip("netns", "delete", name)


@pytest.fixture
def wire() -> Iterator[Wire]:
    need_root("tests/hosts/test_firewall.py")
    need("nft")
    made = Wire()
    yield made
    made.close()


def figures(process: subprocess.Popen[str], count: int) -> list[float]:
    """[ms] of the next joins; -1 for one that failed."""
    assert process.stdout is not None
    return [float(process.stdout.readline()) for _ in range(count)]


@pytest.mark.full
def test_a_laptop_without_a_certificate_keeps_others_from_joining_only_without_the_limits(
    wire: Wire, tmp_path: Path
) -> None:
    lock = Lock(tmp_path / "lock", roles=("viewer",))
    lock.authority.sign([ROUTER], *lock.files("router"), 1)
    files = [str(tmp_path / "lock" / name) for name in ("ca.pem", "router.pem", "router.key")]
    everything: dict[str, object] = {"enabled": False, "default_permission": "allow"}
    (tmp_path / "router.json5").write_text(json.dumps(locked_router(ROUTER, 7447, *files, everything)))
    certificate, key = map(str, lock.files("viewer"))
    own = {
        "GEMELO_ROUTER_HOST": ROUTER, "GEMELO_ROUTER_PORT": "7447", "GEMELO_PATHS_RUN": str(tmp_path / "run"),
        "GEMELO_PATHS_OUT": str(tmp_path / "out"), "PYTHONPATH": str(ROOT),
    }  # fmt: skip
    shown = {"TLS": "true", "CA": files[0], "CERTIFICATE": certificate, "KEY": key}
    joining = own | {f"GEMELO_ROUTER_{name}": value for name, value in shown.items()}
    listening = own | {"GEMELO_ROUTER_CONFIGURATION": str(tmp_path / "router.json5"), "GEMELO_ROUTER_INSECURE": "true"}
    stranger = ("-m", "tests.runtime.stranger")
    router = wire.start(wire.router, sys.executable, "-m", "gemelo.services.router.main", **listening)
    knocks = joins = held = None
    try:
        assert until(lambda: (tmp_path / "run/router.ready").exists(), 20.0)
        joins = wire.start(wire.others, sys.executable, *stranger, "join", **joining)
        assert max(figures(joins, 5)) >= 0.0
        knocks = wire.start(
            wire.others, sys.executable, *stranger, "garbage", ROUTER, "7447", str(KNOCKS), STRANGER, **own
        )
        figures(joins, 2)  # under way as it began
        assert set(figures(joins, 2)) == {-1.0}
        subprocess.run(
            ["ip", "netns", "exec", wire.router, "nft", "-f", "-"],
            input=firewall.firewall(site(tmp_path, '"10.0.0.13"', f'"{DESK}"'), "brain"), text=True, check=True,
        )  # fmt: skip
        # What had come in before the limits is still waiting: up to 128 connections, 0.1 s each.
        assert any(figures(joins, 1)[0] >= 0.0 for _ in range(12))
        found = figures(joins, 8)
        assert min(found) >= 0.0, found
        assert statistics.median(found) < 1000.0
        held = wire.start(wire.others, sys.executable, *stranger, "hold", ROUTER, "7447", "300", DESK, **own)
        assert held.stdout is not None
        assert int(held.stdout.readline()) <= firewall.OPEN_OF_A_HOST
    finally:
        for process in (joins, knocks, held, router):
            if process is not None:
                process.kill()
                process.communicate()
