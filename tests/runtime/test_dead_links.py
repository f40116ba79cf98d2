"""A link that dies without a word is given up within the lease, by both of its ends, and comes back as itself."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from gemelo.libraries.runtime.bus import dead_links
from gemelo.libraries.runtime.bus.dead_links import UNACKNOWLEDGED_MS
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.bus.zenoh_config import locked_router
from tests.optional import need_root
from tests.runtime.locks import Lock
from tests.runtime.support import ROOT, RouterProcess, until
from tests.stack.ethernet import CUT, OPEN, Ethernet
from tests.stack.namespaces import Hosts

ROUTER = "10.77.0.1"
SITE = SimpleNamespace(
    hosts={name: SimpleNamespace(address=f"10.77.0.{index}") for index, name in enumerate(("router", "a", "b"), 1)}
)
PATIENCE = 8.0  # [s] in which a link of a lease of 1 s is missed, and back


def limits(port: int) -> list[int]:
    """[ms] of every connection of this process to the port."""
    found = []
    for opened in dead_links.tcp_sockets():
        with opened:
            try:
                if opened.getpeername()[1] == port:
                    found.append(opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT))
            except OSError:
                continue
    return found


def test_every_session_has_the_limit_on_its_link_also_after_the_router_was_away(tmp_path, monkeypatch):
    monkeypatch.setattr(dead_links, "is_loopback", lambda host: False)
    router = RouterProcess(tmp_path)
    bus = ZenohBus(router.deployment.router, "rm1")
    try:
        assert until(lambda: limits(router.port) == [UNACKNOWLEDGED_MS])
        router.kill()
        assert until(lambda: not bus.is_connected)
        router.start()
        assert until(lambda: limits(router.port) == [UNACKNOWLEDGED_MS], PATIENCE)
    finally:
        bus.close()
        router.stop()


def test_a_link_on_loopback_has_none(tmp_path):
    router = RouterProcess(tmp_path)
    bus = ZenohBus(router.deployment.router, "rm1")
    assert not bus.wait_served("nothing", 0.3)  # by then the other test's session has its limit
    assert limits(router.port) == [0]
    bus.close()
    router.stop()


@pytest.mark.parametrize(
    ("locator", "host", "port"),
    [("tls/10.0.0.1:7447", "10.0.0.1", 7447), ("tcp/[fe80::1%eth0]:52100", "fe80::1%eth0", 52100),
     ("tls/lab.example:1?rel=1#so=2", "lab.example", 1)],
)  # fmt: skip
def test_host_and_port_of_any_locator_are_found(locator, host, port):
    assert (dead_links.host_of(locator), dead_links.port_of(locator)) == (host, port)


class Far:
    """A far_node on a host, and the newest of what it says."""

    def __init__(self, words: tuple[str, ...], environment: dict[str, str]) -> None:
        self.said: dict[str, int] = {}
        self.process = subprocess.Popen(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True)
        self.listening = threading.Thread(target=self._listen, daemon=True)
        self.listening.start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.said = json.loads(line)

    def is_back(self, heard: int) -> bool:
        return bool(self.said["connected"] and self.said["other"] and self.said["heard"] > heard + 100)


@pytest.fixture(scope="module")
def far(tmp_path_factory) -> Iterator[tuple[Ethernet, dict[str, Far]]]:
    need_root("tests/runtime/test_dead_links.py", with_taps=True)
    folder, ethernet = tmp_path_factory.mktemp("far"), Ethernet()
    lock = Lock(folder / "lock", roles=("operator",))
    lock.authority.sign([ROUTER], *lock.files("router"), 1)
    files = [str(folder / "lock" / name) for name in ("ca.pem", "router.pem", "router.key")]
    everything = {"enabled": False, "default_permission": "allow"}
    (folder / "router.json5").write_text(json.dumps(locked_router(ROUTER, 7447, *files, everything)))
    certificate, key = map(str, lock.files("operator"))
    paths = {"GEMELO_PATHS_RUN": str(folder / "run"), "GEMELO_PATHS_OUT": str(folder / "out")}
    own = {"CONFIGURATION": str(folder / "router.json5"), "INSECURE": "true"}
    joining = {"HOST": ROUTER, "TLS": "true", "CA": files[0], "CERTIFICATE": certificate, "KEY": key}
    with ExitStack() as closing:
        hosts = closing.enter_context(Hosts(SITE, ethernet))
        server = closing.enter_context(subprocess.Popen(
            hosts.command("router", sys.executable, "-m", "gemelo.services.router.main"), cwd=ROOT,
            env=os.environ | paths | {f"GEMELO_ROUTER_{name}": value for name, value in own.items()},
        ))  # fmt: skip
        closing.callback(server.kill)
        assert until((folder / "run/router.ready").exists, 20.0)
        nodes = {}
        for name, other in (("a", "b"), ("b", "a")):
            words = hosts.command(name, sys.executable, "-m", "tests.runtime.far_node", name, other)
            environment = os.environ | {f"GEMELO_ROUTER_{each}": value for each, value in joining.items()}
            nodes[name] = Far(words, environment)
            closing.enter_context(nodes[name].process)
            closing.callback(nodes[name].listening.join)
            closing.callback(nodes[name].process.kill)
        assert until(lambda: all(node.said and node.is_back(0) for node in nodes.values()), 20.0)
        yield ethernet, nodes


@pytest.mark.parametrize(("out", "into"), [(CUT, CUT), (CUT, OPEN), (OPEN, CUT)], ids=["both", "out", "into"])
def test_a_peer_whose_cable_is_cut_is_missed_while_it_is_cut_and_heard_under_its_own_keys_when_it_is_healed(
    far, out, into
):
    ethernet, nodes = far
    with ethernet.impaired("b", out, into):
        assert until(lambda: not nodes["a"].said["other"], PATIENCE), "its token lives on"
        assert until(lambda: not nodes["b"].said["connected"], PATIENCE), "it does not know that it is alone"
    heard = {name: node.said["heard"] for name, node in nodes.items()}
    assert until(lambda: all(node.is_back(heard[name]) for name, node in nodes.items()), 2 * PATIENCE), nodes["b"].said
    assert [node.said["wrong"] for node in nodes.values()] == [0, 0]


def test_a_cable_that_is_cut_for_about_as_long_as_the_lease_mixes_no_keys(far):
    ethernet, nodes = far
    for lasts in (0.7, 0.75, 0.8, 0.85, 0.9, 1.0, 1.1):
        with ethernet.impaired("b", CUT, OPEN):
            time.sleep(lasts)  # how long it is cut is what this is about
        heard = {name: node.said["heard"] for name, node in nodes.items()}
        assert until(lambda heard=heard: all(node.is_back(heard[name]) for name, node in nodes.items()), 2 * PATIENCE)
    assert [node.said["wrong"] for node in nodes.values()] == [0, 0]
