"""A router in a process of its own, buses of either kind, and nodes that spin in threads."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from gemelo.libraries.runtime.bus.interface import Bus
from gemelo.libraries.runtime.bus.zenoh_bus import router_answers
from gemelo.libraries.runtime.bus.zenoh_config import router_config
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection

ROOT = Path(__file__).parents[2]
ZENOHD = "GEMELO_TEST_ZENOHD"  # the path of a zenohd that takes the router's place; see deploy/try_zenohd


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def until(is_true: Callable[[], object], timeout: float = 60.0) -> bool:
    """Waits for something that other threads or processes do."""
    end = time.monotonic() + timeout
    while not is_true():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


def hear(node: Node, is_true: Callable[[], object], timeout: float = 60.0) -> bool:
    """Handles the node's inbox until something has come."""
    end = time.monotonic() + timeout
    while not is_true():
        if time.monotonic() > end:
            return False
        node.wait(0.005)
    return True


def zenohd(port: int, folder: Path, configuration: str = "") -> list[str]:
    """How zenohd is started on 127.0.0.1, with a configuration file or with that of the open router."""
    if not configuration:
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / "zenohd.json5"
        file.write_text(str(router_config("127.0.0.1", port)))
        configuration = str(file)
    return [os.environ[ZENOHD], "-c", configuration]


class RouterProcess:
    """`gemelo-router` as a user starts it, or the zenohd that the environment names."""

    def __init__(self, folder: Path) -> None:
        self.port = free_port()
        self.folder = folder
        self.environ = os.environ | {
            "GEMELO_ROUTER_PORT": str(self.port), "GEMELO_PATHS_RUN": str(folder / "run"),
            "GEMELO_PATHS_OUT": str(folder / "out"), "PYTHONPATH": str(ROOT),
        }  # fmt: skip
        self.start()

    def start(self) -> None:
        command = [sys.executable, "-m", "gemelo.services.router.main"]
        if os.environ.get(ZENOHD):
            command = zenohd(self.port, self.folder, self.environ.get("GEMELO_ROUTER_CONFIGURATION", ""))
        self.process = subprocess.Popen(command, cwd=ROOT, env=self.environ, stderr=subprocess.PIPE, text=True)
        assert until(lambda: router_answers("127.0.0.1", self.port), 60.0)

    def kill(self) -> None:
        self.process.kill()
        self._reap()

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self._reap()

    def _reap(self) -> int:
        self.process.communicate(timeout=60.0)
        return self.process.returncode

    @property
    def deployment(self) -> Deployment:
        paths = PathsSection(run=str(self.folder / "run"), out=str(self.folder / "out"))
        return Deployment(router=RouterSection(port=self.port), paths=paths)


class Buses:
    """Opens any number of buses of one kind, and closes them at the end."""

    def __init__(self, make: Callable[[str], Bus], deployment: Deployment) -> None:
        self._make, self.deployment = make, deployment
        self.opened: list[Bus | Node] = []
        self._buses: list[Bus] = []  # of the nodes too

    def open(self, robot: str = "rm1") -> Bus:
        bus = self._bus(robot)
        self.opened.append(bus)
        return bus

    def node(self, name: str, **options: object) -> Node:
        node = Node(name, self.deployment, robot="rm1", bus=self._bus("rm1"), **options)
        self.opened.append(node)
        return node

    def _bus(self, robot: str) -> Bus:
        bus = self._make(robot)
        self._buses.append(bus)
        return bus

    def settle(self) -> None:
        """Waits until every bus knows what all others have declared so far."""
        tokens = [bus.declare_alive(f"@barrier/{index}") for index, bus in enumerate(self._buses)]
        assert until(lambda: all(len(bus.alive("@barrier/*")) == len(self._buses) for bus in self._buses))
        for token in tokens:
            token.close()

    def close(self) -> None:
        for each in reversed(self.opened):
            each.close()


@contextmanager
def spinning(node: Node, step: Callable[[int], object] = lambda now: None, rate: float = 50.0) -> Iterator[Node]:
    """The node spins in a thread of its own."""
    failures: list[BaseException] = []

    def run() -> None:
        try:
            node.spin(step, rate)
        except BaseException as error:
            failures.append(error)

    thread = threading.Thread(target=run, name=node.name)
    thread.start()
    try:
        yield node
    finally:
        node.stop()
        thread.join(timeout=60.0)
    assert not thread.is_alive(), "the loop did not stop"
    assert not failures, failures


@contextmanager
def programs(router: RouterProcess) -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Starts Python programs by their arguments, with more environment where that is given; ends all of them."""
    started: list[subprocess.Popen[str]] = []

    def start(*arguments: str, **environ: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, *arguments], cwd=ROOT, env=router.environ | environ, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()
