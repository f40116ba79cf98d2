"""`gemelo-viewer`: runs the Rerun viewer on loopback, and says where it is and whether it answers.

The viewer is a child rather than this process itself because somebody has to keep the readiness file, and to look at
what a browser asks for: the child listens on an address of its own, which only this process knows.
"""

from __future__ import annotations

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO, TextIO
from urllib.parse import quote

from msgspec.structs import replace

from gemelo.libraries.runtime.deployment import DeploymentError, exposure, load_deployment, project_root
from gemelo.libraries.runtime.process.own_names import own_names
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.process.priority import lower_priority
from gemelo.libraries.runtime.process.readiness import Readiness
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.deployment import Deployment, ViewerMode, ViewerSection
from gemelo.services.visualizer.program.host_check import HostCheck, unguessable_host
from gemelo.services.visualizer.program.rerun_program import free_port, rerun_binary, start, stop
from gemelo.services.visualizer.program.viewer_connection import ViewerConnection

PERIOD = 0.5  # [s] between two looks at the child
CUT_OFF = "viewer: a sender ended or was cut off in the midst of a message; a visualizer comes back by itself"
LATE_HISTORY = "16MB"  # chosen: some minutes of the twin; static data, such as the arm's meshes, stays
EARLY = 5.0  # [s] a native viewer that ends sooner had no display that it could use


def resolved(mode: ViewerMode, environ: Mapping[str, str], platform: str = sys.platform) -> ViewerMode:
    """AUTO made definite: native where there is a display."""
    if mode is not ViewerMode.AUTO:
        return mode
    has_display = platform != "linux" or bool(environ.get("DISPLAY") or environ.get("WAYLAND_DISPLAY"))
    return ViewerMode.NATIVE if has_display else ViewerMode.WEB


def command(program: Path, viewer: ViewerSection, mode: ViewerMode, memory: str) -> list[str]:
    """The command line of the program.

    A page that is opened late is sent the newest data first, what comes live before the past, and of that only
    `LATE_HISTORY`: a browser that draws slowly would else play hours before it shows the arm as it is.
    """
    common = [str(program), "--bind", viewer.host, "--port", str(viewer.port)]
    limits = ["--memory-limit", memory, "--server-memory-limit", LATE_HISTORY]
    if mode is ViewerMode.WEB:
        return [*common, "--serve-web", "--web-viewer-port", str(viewer.web_port), "--newest-first", *limits]
    return [*common, *limits, "--hide-welcome-screen"]


def address(viewer: ViewerSection, mode: ViewerMode) -> str:
    """The address of the view, for a person."""
    stream = f"rerun+http://{viewer.host}:{viewer.port}/proxy"
    if mode is ViewerMode.WEB:
        return f"http://{viewer.host}:{viewer.web_port}/?url={quote(stream, safe='')}"
    return f"a window on this display (data: {stream})"


def run(deployment: Deployment, memory: str, stopping: threading.Event) -> int:
    """Keep the viewer and its readiness until asked to stop; returns the exit code."""
    run_folder = project_root() / deployment.paths.run
    unwritten = UnwrittenFiles(lambda said: say(f"viewer: {said}"))
    readiness = Readiness(run_folder, "viewer", unwritten)
    mode = resolved(deployment.viewer.mode, os.environ)
    try:
        if mode is ViewerMode.NONE:
            return _idle(readiness, stopping)
        if warning := exposure("viewer", deployment.viewer.host, False, deployment.viewer.insecure):
            say(f"viewer: {warning}")
        require_free(deployment.viewer.host, deployment.viewer.port, "viewer")
        if mode is ViewerMode.WEB:
            require_free(deployment.viewer.host, deployment.viewer.web_port, "viewer", "web_port")
        code = _keep(deployment, mode, memory, readiness, stopping)
        if code and mode is not deployment.viewer.mode and mode is ViewerMode.NATIVE and not stopping.is_set():
            say("viewer: no window could be opened; showing it in the browser instead")
            return _keep(deployment, ViewerMode.WEB, memory, readiness, stopping)
        return code
    except (DeploymentError, PortTaken) as error:
        return _say_error(f"viewer: {error}")
    finally:
        readiness.not_ready()


def say(text: str, to: TextIO | None = None) -> None:
    """Prints a line; that nobody takes it, as a full disk, is no reason to end."""
    with suppress(OSError):
        print(text, file=to, flush=True)


def _idle(readiness: Readiness, stopping: threading.Event) -> int:
    say("viewer: none wanted (viewer.mode is `none`)")
    readiness.ready()
    while not stopping.wait(1.0):
        readiness.beat()
    return 0


def hidden(viewer: ViewerSection) -> ViewerSection:
    """Where the program itself listens."""
    host = unguessable_host()
    return replace(viewer, host=host, port=free_port(host), web_port=free_port(host))


def host_check(deployment: Deployment, behind: ViewerSection, mode: ViewerMode) -> HostCheck:
    """The ports of the deployment, in front of those where the program listens."""
    viewer = deployment.viewer
    ports = {(viewer.host, viewer.port): (behind.host, behind.port)}
    if mode is ViewerMode.WEB:
        ports[viewer.host, viewer.web_port] = (behind.host, behind.web_port)
    return HostCheck(ports, own_names(viewer.host, deployment.panel.name))


def _keep(
    deployment: Deployment, mode: ViewerMode, memory: str, readiness: Readiness, stopping: threading.Event
) -> int:
    """Run the viewer once. A native one that ends well was closed by its user; a web one never ends by itself."""
    behind = hidden(deployment.viewer)
    connection = ViewerConnection(behind.host, behind.port)
    started, is_open = time.monotonic(), False
    with ExitStack() as ends:
        ends.callback(connection.close)
        child = start(command(rerun_binary(), behind, mode, memory), stderr=subprocess.PIPE)
        ends.callback(stop, child)
        threading.Thread(target=_relay, args=(child.stderr,), daemon=True, name="viewer's errors").start()
        while not stopping.wait(PERIOD):
            if child.poll() is not None:
                return _ended(child, mode, time.monotonic() - started)
            is_new = connection.is_new(time.monotonic())
            if is_new and not is_open:
                ends.enter_context(host_check(deployment, behind, mode))
                is_open = True
            _beat(connection, is_new, readiness, address(deployment.viewer, mode))
    return 0


def _relay(errors: IO[bytes] | None) -> None:
    """Passes the program's errors on; a sender that was cut off is said in words, not in those of its protocol."""
    for line in errors or ():
        text = line.decode(errors="replace").rstrip()
        say(CUT_OFF if "h2 protocol error" in text else text, sys.stderr)


def _beat(connection: ViewerConnection, is_new: bool, readiness: Readiness, where: str) -> None:
    if is_new:
        say(f"viewer: {where}")
        readiness.ready()
    elif connection.is_alive:
        readiness.beat()
    else:
        readiness.not_ready("the rerun program does not accept a connection")


def _ended(child: subprocess.Popen[bytes], mode: ViewerMode, age: float) -> int:
    if child.returncode == 0 and mode is ViewerMode.NATIVE and age > EARLY:
        say("viewer: closed")
        return 0
    return _say_error(f"viewer: the rerun program ended with code {child.returncode} after {age:.1f} s")


def _say_error(sentence: str) -> int:
    say(sentence, sys.stderr)
    return 1


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="gemelo-viewer", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, help="deployment file")
    parser.add_argument("--memory-limit", default="1GB", help="of the viewer's store, for example 1GB or 25%%")
    parser.add_argument("--log-level", default="INFO", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    lower_priority()
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    try:
        sys.exit(run(load_deployment(arguments.config), arguments.memory_limit, stopping))
    except (RuntimeError, ValueError) as error:
        sys.exit(f"viewer: {error}")


if __name__ == "__main__":
    main()
