"""The page's own server in the tests' process, and a browser that does not draw: what it shows can be looked at."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import gemelo
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.joints import JointState
from gemelo.services.panel.main import Panel
from gemelo.services.panel.view.browser import STOP_SIGN
from gemelo.services.panel.view.page import Page
from gemelo.services.panel.view.world import DrawnWorld
from gemelo.services.panel.words.en import ENGLISH
from gemelo.tools.bench.bare_browser import BareBrowser, Said, bare_browser
from tests.panel.person import until

HELD_RATE = 20.0  # [Hz]


class Served:
    """The page, in English, and somebody at it."""

    browser: BareBrowser

    def __init__(self, panel: Panel) -> None:
        self.operator, self.panel = panel.operator, panel
        self.address = f"127.0.0.1:{panel.server.get_port()}"
        self.labels: dict[str, str] = {}  # in the drawing, by their node

    def hear(self, said: Said, at: float) -> None:
        """Each message that the browser gets."""
        if said["type"] == "LabelMessage":
            self.labels[said["name"]] = said["props"]["text"]
        elif said["type"] == "RemoveSceneNodeMessage":
            self.labels = {node: text for node, text in self.labels.items() if not node.startswith(said["name"])}

    @property
    def page(self) -> Page:
        """As it is built for the first browser."""
        return self.panel.pages()[0]

    @property
    def world(self) -> DrawnWorld:
        """What is drawn."""
        return self.panel.world

    @property
    def said(self) -> tuple[object, ...]:
        """All that it shows, and what the run and the arm are at."""
        arm, state = self.operator.arm, self.operator.teaching.state
        return self.browser.texts, self.operator.newest_problem, state, arm.device.mode, arm.joints, arm.velocities

    def press(self, key: str) -> None:
        """The newest button of that word."""
        if key == "stop":
            self.browser.press(STOP_SIGN)
        else:
            self.browser.press_exactly(ENGLISH[key])

    def choose(self, key: str, value: str | bool) -> None:
        """Of the drop-down or checkbox of that word."""
        self.browser.choose(ENGLISH[key], value)

    def told(self, text: str) -> None:
        """Waits until the page has a problem that says so."""
        until(lambda: self.page.problem.content, lambda content: text in content)

    def holds(self, label: str, until_this: Callable[[], bool]) -> None:
        """Holds the button of that label until it is so, and lets it go."""

        def hold() -> bool:
            self.browser.hold(label, HELD_RATE)
            return until_this()

        until(hold, bool)


@contextmanager
def served_page() -> Iterator[Served]:
    """The page of the deployment that the environment names."""
    deployment = load_deployment()
    with gemelo.connect(name="page", timeout=60.0) as connected:
        panel, stop = Panel(connected, deployment, logging.getLogger("page")), ShutdownRequest()
        thread = threading.Thread(target=panel.run, args=(stop,), daemon=True)
        thread.start()
        try:
            served = Served(panel)
            with bare_browser(served.address, served.hear) as served.browser:
                until(panel.pages, bool)
                served.browser.wait_for(ENGLISH["plan"])
                yield served
        finally:
            stop.set()
            thread.join(60.0)
            panel.close()


@contextmanager
def passed(arm: gemelo.Arm, joint: str) -> Iterator[list[float]]:
    """Where that joint has been meanwhile, [rad] or [m]."""
    seen: list[float] = []

    def note(state: JointState) -> None:
        seen.append(state.position[state.name.index(joint)])

    heard = arm.node.subscribe(gemelo.topics.JOINT_STATES, note)
    yield seen
    heard.close()


def rests(arm: gemelo.Arm) -> None:
    """Waits for it."""
    until(lambda: arm.velocities, lambda speeds: all(abs(speed) < 1e-3 for speed in speeds.values()))
