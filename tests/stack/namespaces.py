"""Hosts as network namespaces on one bridge or switch, and the processes of a rendered site in them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import msgspec

from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.site import Site
from gemelo.tools.hosts.keys import make_keys
from gemelo.tools.hosts.layout import processes
from gemelo.tools.hosts.render import write
from tests.stack.ethernet import Ethernet

READY = 60.0  # [s] for all processes of all hosts
LAN = "lan"  # the namespace of the bridge


class Hosts:
    """One namespace for each host of a site, with its address; a link can be cut and healed.

    They meet on a bridge of the kernel, or on `ethernet`, whose cables also delay and cut one direction only.
    """

    def __init__(self, site: Site, ethernet: Ethernet | None = None) -> None:
        self._site, self._ethernet, self._prefix = site, ethernet, f"gemelo{os.getpid()}-"

    def __enter__(self) -> Hosts:
        try:
            for name in (LAN, *self._site.hosts):
                _ip("netns", "add", self.namespace(name))
            self._in(LAN, "link", "add", "bridge", "type", "bridge")
            self._in(LAN, "link", "set", "bridge", "up")
            for name, host in self._site.hosts.items():
                self._join(name, host.address)
            if self._ethernet is not None:
                self._ethernet.start()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._ethernet is not None:
            self._ethernet.close()
        for name in (*self._site.hosts, LAN):
            subprocess.run(["ip", "netns", "delete", self.namespace(name)], check=False, stderr=subprocess.DEVNULL)

    def namespace(self, host: str) -> str:
        return f"{self._prefix}{host}"

    def command(self, host: str, *words: str) -> tuple[str, ...]:
        """The command, run on that host, which has its name too."""
        named = ("unshare", "--uts", "sh", "-c", 'hostname "$0" && exec "$@"', host)
        return ("ip", "netns", "exec", self.namespace(host), *named, *words)

    @contextlib.contextmanager
    def cut(self, host: str) -> Iterator[None]:
        """The host's link is down for as long as the block runs."""
        self._in(LAN, "link", "set", f"to-{host}", "down")
        try:
            yield
        finally:
            self._in(LAN, "link", "set", f"to-{host}", "up")

    def _join(self, host: str, address: str) -> None:
        if self._ethernet is not None:
            self._ethernet.plug(host, self.namespace(host))
        else:
            end = f"to-{host}"
            self._in(LAN, "link", "add", end, "type", "veth", "peer", "name", "eth0", "netns", self.namespace(host))
            self._in(LAN, "link", "set", end, "master", "bridge", "up")
        self._in(host, "address", "add", f"{address}/24", "dev", "eth0")
        for link in ("lo", "eth0"):
            self._in(host, "link", "set", link, "up")

    def _in(self, host: str, *words: str) -> None:
        _ip("-n", self.namespace(host), *words)


def _ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"ip {' '.join(words)}: {done.stderr}"


class Lab:
    """A site whose hosts are namespaces, each with the files that it would be given, run by process-compose."""

    def __init__(self, site: Site, hosts: Hosts, folder: Path) -> None:
        self._hosts, self._folder, self._servers = hosts, folder, []
        self.sites = {
            name: msgspec.structs.replace(
                site, project=str(project_root()), config=str(folder / name), state=str(folder / "state" / name)
            )
            for name in site.hosts
        }  # fmt: skip
        make_keys(site, folder, project_root())
        for name, own in self.sites.items():
            write(own, name, folder / name)

    def __enter__(self) -> Lab:
        try:
            for name, site in self.sites.items():
                if list(processes(site, name)):
                    self._start(name)
            self._wait_ready()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for server in self._servers:
            server.send_signal(signal.SIGTERM)
        for server in self._servers:
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(60.0)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(server.pid, signal.SIGKILL)

    def environment(self, host: str, robot: str) -> dict[str, str]:
        """What a person on that host has set."""
        return os.environ | {"GEMELO_CONFIG": str(self._folder / host / f"{robot}.toml")}

    def _start(self, host: str) -> None:
        words = (str(project_root() / ".venv/bin/process-compose"), "up", "-t=false", "-f", "process-compose.yaml")
        with (self._folder / f"{host}.log").open("wb") as log:
            self._servers.append(subprocess.Popen(
                self._hosts.command(host, *words), cwd=self._folder / host, stdin=subprocess.DEVNULL, stdout=log,
                stderr=subprocess.STDOUT, start_new_session=True,
                env=os.environ | {"PC_SOCKET_PATH": str(self._folder / f"{host}.sock"), "PC_USE_UDS": "1",
                                  "PC_LOG_FILE": str(self._folder / f"{host}.pc.log"),
                                  "PROC_COMP_CONFIG": str(self._folder / host)},
            ))  # fmt: skip

    def _wait_ready(self) -> None:
        wanted = [
            Path(site.state, process.robot or "host", "run", f"{process.service.name}.ready")
            for name, site in self.sites.items() for process in processes(site, name)
        ]  # fmt: skip
        end = time.monotonic() + READY
        while missing := [str(file) for file in wanted if not file.exists()]:
            assert time.monotonic() < end, f"not ready: {missing}\n{self.logs()}"
            time.sleep(0.05)

    def logs(self) -> str:
        """What all processes have said."""
        return "\n".join(f"== {file.stem}\n{file.read_text(errors='replace')}" for file in self._folder.glob("*.log"))
