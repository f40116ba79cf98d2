"""`gemelo-panel`: serves the operator's page, and says where it is and whether what it shows is live."""

from __future__ import annotations

import argparse
import contextlib
import gc
import logging
import sys
import threading
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import viser

import gemelo
from gemelo.libraries.runtime.deployment import DeploymentError, exposure, load_deployment
from gemelo.libraries.runtime.process.logs import LEVELS, line_logger
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.process.readiness import tell_alive
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest, end_soon, end_with_any_thread, stop_on_signals
from gemelo.schemas.deployment import Deployment
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.arm_pages import arm_pages
from gemelo.services.panel.view.broken_connections import BrokenConnections
from gemelo.services.panel.view.own_pages import OwnServer, own_pages_only

if TYPE_CHECKING:
    from gemelo.services.panel.view.page import Page
    from gemelo.services.panel.view.world import DrawnWorld

NAME = "panel"
APART = 0.02  # [s] at least from the beginning of one picture to the next, however much is dragged
TEXTS = 5.0  # [Hz]
LOOK_FOR_TWIN = 2.0  # [s] of one look


class Panel:
    """The server, and one page for each browser that is open."""

    def __init__(self, arm: gemelo.Arm, deployment: Deployment, log: logging.Logger) -> None:
        self._arm, self._log = arm, log
        self._pages: dict[int, Page] = {}
        self._arms = arm_pages(deployment)
        self._lock, self._making = threading.Lock(), threading.Lock()
        self._world: DrawnWorld | None = None
        self._texts_at = -1.0 / TEXTS  # [s] monotonic
        self.operator = Operator(arm)
        self._broken = BrokenConnections(log.warning)
        own_pages = own_pages_only(deployment.panel.host, self._broken, deployment.panel.name)
        with contextlib.redirect_stdout(None), own_pages:  # without its own greeting
            self.server = OwnServer(deployment.panel.host, deployment.panel.port, verbose=False)
        self.server.on_client_connect(self._open)
        self.server.on_client_disconnect(self._close)
        log.info(f"page: http://{deployment.panel.host}:{deployment.panel.port}")

    @property
    def world(self) -> DrawnWorld:
        """The picture; made for the first browser, as what draws it is more than half of this process's memory."""
        with self._making:
            if self._world is None:
                from gemelo.services.panel.view.world import DrawnWorld  # slow to load: trimesh comes with it

                self._world = DrawnWorld(self.server, self.operator)
                gc.freeze()  # as in `run`
            return self._world

    def run(self, stop: ShutdownRequest) -> None:
        """Draws until it is asked to stop, when something has changed; ready while the arm's state is live."""
        gc.freeze()  # what is loaded by now stays: to look through it again would hold up everything for 0.1 s
        try:
            followed = 0.0  # [s] monotonic, of the last picture that somebody asked for
            while not stop.is_set:
                self.draw(time.monotonic())
                period = 1.0 / TEXTS if self._world is None else min(1.0 / TEXTS, self._world.period)
                if self.operator.wait(period):
                    time.sleep(max(0.0, followed + APART - time.monotonic()))
                    followed = time.monotonic()
        finally:
            gc.unfreeze()

    def draw(self, now: float) -> None:
        """One picture at `now` [s] monotonic, and the texts when their time has come."""
        bus = self.operator.bus
        self._broken.report(now)
        self._arm.node.set_ready(bus.is_live, "" if bus.is_live else "no fresh joint_states")
        joints = bus.joints
        if self._world is not None:
            with self.server.atomic():  # one message for all of it
                self._world.update(joints)
            self.server.flush()  # else viser waits for a sixtieth of a second
        bus.pace.drawn(tuple(joints.values()), now)
        if now - self._texts_at >= 1.0 / TEXTS:
            self._texts_at, readings = now, bus.read()
            for page in self.pages():
                self._refresh(page, readings, now)

    def close(self) -> None:
        """Ends the server; the arm brakes where the page has led it."""
        self.operator.close()
        self.server.stop()

    def _refresh(self, page: Page, readings: Readings, now: float) -> None:
        """A browser may go at any moment, with everything that was built for it."""
        try:
            with page.client.atomic():
                page.refresh(readings, now)
        except Exception:
            if page in self.pages():
                raise

    def pages(self) -> list[Page]:
        """One for each browser that is here."""
        with self._lock:
            return list(self._pages.values())

    def _open(self, client: viser.ClientHandle) -> None:
        from gemelo.services.panel.view.page import Page  # slow to load: the picture comes with it

        try:
            page = Page(client, self.operator, self.world, self._arms)
        except Exception as error:
            self._log.error("the arm cannot be drawn: %s", error)
            raise
        with self._lock:
            self._pages[client.client_id] = page
        self._log.info(f"browser {client.client_id} is here; {len(self.pages())} in all")

    def _close(self, client: viser.ClientHandle) -> None:
        with self._lock:
            page = self._pages.pop(client.client_id, None)
        if page is not None:
            page.close()
        self._log.info(f"browser {client.client_id} has gone; {len(self.pages())} in all")


def run(deployment: Deployment, config: Path | None, log: logging.Logger, stop: ShutdownRequest) -> int:
    """Waits for the twin, then serves the page; returns the exit code."""
    try:
        if warning := exposure(NAME, deployment.panel.host, False, deployment.panel.insecure):
            log.warning("%s", warning)
        require_free(deployment.panel.host, deployment.panel.port, NAME)
    except (DeploymentError, PortTaken) as error:
        log.error("%s", error)
        return 1
    arm = _connected(config, log, stop)
    if arm is None:
        return 0
    with arm:
        panel = Panel(arm, deployment, log)
        try:
            panel.run(stop)
        finally:
            panel.close()
    return 0


def _connected(config: Path | None, log: logging.Logger, stop: ShutdownRequest) -> gemelo.Arm | None:
    """The arm, as soon as its gateway is there; None if the process is to end before."""
    told = ""
    while not stop.is_set:
        tell_alive()
        try:
            arm = gemelo.connect(deployment=config, name=NAME, timeout=LOOK_FOR_TWIN)
            arm.control.shares = False  # the page is for whoever opens it, not for whose process it is
            try:
                require_known(arm)
                return arm
            except BaseException:
                arm.close()
                raise
        except gemelo.Lost as lost:
            if str(lost) != told:
                told = str(lost)
                log.warning(f"waiting: {told}")
    return None


def require_known(arm: gemelo.Arm) -> None:
    """Raises `Lost` until both the gateway and the planner answer.

    The planner is asked of all joints by name: one that has just started knows no joint state yet, and would refuse.
    """
    arm.fk(arm.joints)


def main() -> None:
    """Entry point."""
    parser = argparse.ArgumentParser(prog="gemelo-panel", description=__doc__)
    parser.add_argument("--config", type=Path, default=None, metavar="FILE", help="deployment file [deploy/local.toml]")
    parser.add_argument("--log-level", default="info", choices=LEVELS)
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore", message="Queued a .* on a closed connection")  # a browser that has just gone
    log, stop = line_logger(NAME, arguments.log_level), ShutdownRequest()
    end_with_any_thread(log, lambda: stop.is_set)  # above all with the one that sends a Stop
    try:
        with stop_on_signals(stop):
            code = run(load_deployment(arguments.config), arguments.config, log, stop)
    except (gemelo.Error, ValueError) as error:
        log.error("%s", error)
        code = 1
    end_soon(code)
    sys.exit(code)


if __name__ == "__main__":
    main()
