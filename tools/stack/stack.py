"""The whole stack for tests, demo and bench: process-compose on free ports, with run and output folders of its own."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.process.readiness import says_ready
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.stack.compose import Compose, ComposeError
from gemelo.tools.stack.guard import Guard
from gemelo.tools.stack.not_ready import NotReady, not_ready

PROCESSES = (
    "router",
    "broker",
    "virtual_esp32",
    "stepper_gateway",
    "state_publisher",
    "planner",
    "logger",
    "visualizer",
    "viewer",
    "panel",
    "camera",
    "detector",
)
POLL = 0.05  # [s]
STOP = 20.0  # [s] for all to end by themselves


class StackError(ReasonedError):
    """The stack did not start or did not do what was asked; the text holds the end of the logs concerned.

    `unready` says of each process that is not ready why.
    """

    def __init__(self, text: Reason | str, unready: Sequence[NotReady] = ()) -> None:
        super().__init__(text)
        self.unready = tuple(unready)


class Stack:
    """Starts on entering, stops on leaving, or when this process ends; each process can be killed by name.

    `viewer="none"` leaves the viewer's process out, `panel` adds the operator's page; without GEMELO_CELL in
    `environment` the cameras are left out, which would stand aside.
    `locked_for` names the device for which mosquitto gets TLS, users and an ACL; `lock` is their folder then.
    `environment` is added to what the stack gets.
    `command` starts it in another way, for example ("make", "up").
    """

    def __init__(
        self,
        *,
        broker: str = "embedded",
        locked_for: str = "",
        viewer: str = "none",
        panel: bool = False,
        out: Path | None = None,
        processes: Sequence[str] | None = None,
        environment: Mapping[str, str] | None = None,
        command: Sequence[str] | None = None,
        ready_timeout: float = 120.0,
    ) -> None:
        self.root = project_root()
        self.folder = Path(tempfile.mkdtemp(prefix="gemelo-"))
        self.run = self.folder / "run"
        self.out = (out or self.folder / "out").resolve()
        has_cell = bool((environment or {}).get("GEMELO_CELL"))
        chosen = (("viewer", viewer != "none"), ("panel", panel), ("camera", has_cell), ("detector", has_cell))
        left_out = {name for name, wanted in chosen if not wanted}
        self.processes = tuple(processes or (name for name in PROCESSES if name not in left_out))
        self.ready_seconds = 0.0
        self._command = command
        self._ready_timeout = ready_timeout
        self.socket = self.folder / "process-compose.sock"
        self.compose = Compose(self.socket)
        self.server: subprocess.Popen[bytes] | None = None
        self._guard: Guard | None = None
        router, mqtt, grpc, web, page = free_ports(5)
        self.deployment: dict[str, str] = {
            "GEMELO_ROUTER_PORT": str(router),
            "GEMELO_MQTT_PORT": str(mqtt),
            "GEMELO_MQTT_BROKER": broker,
            "GEMELO_VIEWER_MODE": viewer,
            "GEMELO_VIEWER_PORT": str(grpc),
            "GEMELO_VIEWER_WEB_PORT": str(web),
            "GEMELO_PANEL_PORT": str(page),
            "GEMELO_PATHS_RUN": str(self.run),
            "GEMELO_PATHS_OUT": str(self.out),
            "GEMELO_STARTED": str(self.folder / "started.toml"),  # that of the folder is the user's own twin's
            **(environment or {}),
        }
        self.lock = self.folder / "lock"
        if locked_for:
            secure_folder.make(self.lock, ["127.0.0.1"], [locked_for])
            self.deployment["GEMELO_MQTT_SECURE_FOLDER"] = str(self.lock)

    @property
    def environment(self) -> dict[str, str]:
        """The environment in which clients of this stack run."""
        return {**os.environ, **self.deployment}

    def __enter__(self) -> Stack:
        try:
            self.start()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Starts every process and waits until all are ready; sets `ready_seconds` [s]; raises `StackError`."""
        self.run.mkdir(parents=True, exist_ok=True)
        self.out.mkdir(parents=True, exist_ok=True)
        started = time.monotonic()
        arguments = self._command or (str(_process_compose(self.root)), "up", "-t=false", "--no-deps", *self.processes)
        with (self.folder / "console.log").open("wb") as console:
            self.server = subprocess.Popen(
                arguments,
                cwd=self.root,
                env={
                    **self.environment,
                    "PC_SOCKET_PATH": str(self.socket),
                    "PC_LOG_FILE": str(self.folder / "process-compose.log"),
                    "PROC_COMP_CONFIG": str(self.folder),
                },
                stdin=subprocess.DEVNULL,
                stdout=console,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._guard = Guard(self.server.pid)
        self.wait_ready(self._ready_timeout)
        self.ready_seconds = time.monotonic() - started

    def stop(self) -> int | None:
        """Ends all processes as Ctrl-C would; returns the exit code of process-compose, None if it did not run."""
        server, self.server = self.server, None
        guard, self._guard = self._guard, None
        code = None
        if server is not None:
            server.send_signal(signal.SIGTERM)
            if guard is not None:
                guard.close()
            try:
                code = server.wait(STOP)
            except subprocess.TimeoutExpired:
                code = self._kill_all(server)
        shutil.rmtree(self.folder, ignore_errors=True)
        return code

    def _kill_all(self, server: subprocess.Popen[bytes]) -> int:
        with contextlib.suppress(ComposeError):
            for pid in self.pids().values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        server.kill()
        return server.wait()

    def wait_ready(self, timeout: float, names: Sequence[str] | None = None) -> None:
        """Waits until all processes, or `names`, are ready; raises `StackError` after `timeout` [s]."""
        wanted = tuple(names or self.processes)
        deadline = time.monotonic() + timeout
        missing = wanted
        while time.monotonic() < deadline:
            if self.server is None or self.server.poll() is not None:
                raise StackError(because("stack.ended", console=self.console()[-2000:]))
            missing = tuple(name for name in missing if not self.is_ready(name))
            if not missing:
                return
            time.sleep(POLL)
        unready = self.why_not_ready(missing)
        lines = [*map(str, unready), *([] if any(each.lines for each in unready) else [self.console()[-1000:]])]
        names, load = ", ".join(missing), os.getloadavg()[0]
        why = because("stack.not_ready", time=timeout, names=names, load=load, console="\n".join(lines))
        raise StackError(why, unready)

    def is_ready(self, name: str) -> bool:
        """As deploy/probe: True if `name` has said so within the last 3 s."""
        return says_ready(self.run, name)

    def why_not_ready(self, names: Sequence[str] | None = None) -> tuple[NotReady, ...]:
        """Of each of `names`, by default of all that are not ready at this moment, the reason and the last lines."""
        try:
            states = {state.name: state for state in self.compose.processes()}
        except ComposeError:
            states = {}
        names = [name for name in self.processes if not self.is_ready(name)] if names is None else names
        return tuple(not_ready(name, states.get(name), self.run, self.logs(name)) for name in names)

    def pid(self, name: str) -> int:
        """The process id that `name` has now; 0 while it does not run."""
        state = self.compose.process(name)
        return state.pid if state.is_running else 0

    def pids(self) -> dict[str, int]:
        """Every process that runs, by name."""
        return {state.name: state.pid for state in self.compose.processes() if state.is_running}

    def kill(self, name: str, number: signal.Signals = signal.SIGKILL) -> int:
        """Sends signal `number` to the process and, for SIGKILL, removes its ready file; returns its process id.

        Raises `StackError` if it does not run.
        """
        pid = self.pid(name)
        if pid == 0:
            raise StackError(because("stack.not_running", name=name))
        os.kill(pid, number)
        if number is signal.SIGKILL:
            with contextlib.suppress(OSError):  # on a read-only disk it is old soon
                (self.run / f"{name}.ready").unlink()
        return pid

    def logs(self, name: str) -> str:
        """Everything that `name` has printed; empty if nothing."""
        try:
            return (self.out / "logs" / f"{name}.log").read_text(errors="replace")
        except FileNotFoundError:
            return ""

    def console(self) -> str:
        """Everything that process-compose itself has printed."""
        return (self.folder / "console.log").read_text(errors="replace")


def free_ports(count: int) -> tuple[int, ...]:
    """`count` different TCP ports of 127.0.0.1 on which nobody listens now."""
    sockets = [socket.socket() for _ in range(count)]
    try:
        for each in sockets:
            each.bind(("127.0.0.1", 0))
        return tuple(int(each.getsockname()[1]) for each in sockets)
    finally:
        for each in sockets:
            each.close()


def _process_compose(root: Path) -> Path:
    found = root / ".venv/bin/process-compose"
    if not found.exists():
        raise StackError(because("stack.no_compose"))
    return found
