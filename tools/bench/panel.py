"""The figures of the operator's page: what it costs, its lag, how soon its space bar stops, how fast a goal follows.

A browser without a graphics card draws on the same cores, so what is measured beside one measures the machine as well;
what a browser that does not draw sees is the page's own.
"""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import cos, pi, sin

import msgspec
import psutil
from playwright.sync_api import Page, sync_playwright

import gemelo
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.schemas.joints import JointState
from gemelo.services.panel.model.goal import GoalSolver
from gemelo.services.panel.model.pace import UNSEEN
from gemelo.services.panel.view.browser import STOP_SIGN
from gemelo.tools.bench.bare_browser import Said, bare_browser
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile
from gemelo.tools.bench.stack import Stacks, has_mosquitto
from gemelo.tools.bench.stops import StopWire
from gemelo.tools.stack.stack import Stack

FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1280, "height": 720}
SETTLE, WINDOW, WINDOWS = 3.0, 2.0, 5  # [s], [s], of CPU
MOVES, STOPS = 20, 20
DRAG = 4.0  # [s]
MEASURED = "/measured"  # the scene's node under which the measured arm is drawn
AFTER_MOVE = 0.2  # [s]
AMPLITUDE = 0.02  # [m] radius of the circle that is dragged
PATIENCE = 60.0  # [s]
REST_GOAL, MOVING_GOAL = FigureGoal(median=5.0), FigureGoal(median=15.0)  # [% of a core]
DRAG_GOAL = FigureGoal(least=20.0)  # [Hz]
LAG = re.compile(r"· \d+ ms")  # in the header of a page that a browser has drawn


@dataclass
class Opened:
    """A twin with a page, and an arm that can move."""

    stack: Stack
    arm: gemelo.Arm
    address: str  # of the page, host and port

    def panel_cpu(self) -> float:
        """[s] that the panel's process has used."""
        times = psutil.Process(self.stack.pid("panel")).cpu_times()
        return float(times.user + times.system)


def panel_cpu_percent(stacks: Stacks) -> Figure:
    """CPU [% of a core] of the panel while the arm moves, with one browser; the references are at rest, and without
    what a browser's drawing does to the machine."""
    with opened(stacks) as twin:
        with bare_browser(twin.address, lambda said, at: None):
            bare_rest, bare_moving = _shares_at_rest_and_moving(twin)
        with _chromium(twin):
            rest, moving = _shares_at_rest_and_moving(twin)
    bare = {"bare browser": quantile(bare_moving, 0.5), "bare browser, at rest": quantile(bare_rest, 0.5)}
    return judged_cpu(rest, moving, bare)


def judged_cpu(rest: Sequence[float], moving: Sequence[float], reference: Mapping[str, float]) -> Figure:
    """The figure of CPU [% of a core] in windows at `rest` and while `moving`, each with its goal; and `reference`."""
    note = f"{WINDOWS} windows of {WINDOW:g} s; a bare browser does not draw"
    at_rest = of_samples(rest, REST_GOAL)
    figure = of_samples(moving, MOVING_GOAL, {"at rest": quantile(rest, 0.5), **reference}, note)
    goal = f"{figure.goal}, at rest {at_rest.goal}"
    return msgspec.structs.replace(figure, goal=goal, met=bool(figure.met and at_rest.met))


def panel_lag_ms(stacks: Stacks) -> Figure:
    """From a joint state on the bus, the first that moves, to the message with it on the way to a browser [ms]."""
    with opened(stacks) as twin:
        drawn: list[float] = []

        def note_drawn(said: Said, at: float) -> None:
            if str(said.get("name", "")).startswith(MEASURED):
                drawn.append(at)

        with bare_browser(twin.address, note_drawn):
            bare = _lags(twin, drawn)
            with _chromium(twin):
                lags = _lags(twin, drawn)
    note = f"{MOVES} moves from rest beside a browser without a graphics card; a bare browser does not draw"
    return of_samples(lags, FigureGoal(p99=60.0), _of_bare(bare), note)


def stop_key_ms(stacks: Stacks) -> Figure:
    """From the space bar to the STOP frame on the wire [ms], while the arm moves; the reference is from the word of a
    browser that does not draw."""
    with opened(stacks) as twin:
        wire = StopWire(int(twin.stack.deployment["GEMELO_MQTT_PORT"]), twin.arm.description.device.name)
        try:
            with bare_browser(twin.address, lambda said, at: None) as browser:
                browser.wait_for(STOP_SIGN)
                bare = [_stopped(twin, wire, lambda: browser.press(STOP_SIGN)) for _ in range(STOPS)]
            with _chromium(twin) as page:
                page.get_by_text(LAG).wait_for(timeout=1000.0 * PATIENCE)
                time.sleep(SETTLE)
                taken = [_stopped(twin, wire, lambda: page.keyboard.press("Space")) for _ in range(STOPS)]
        finally:
            wire.close()
    note = (
        f"{STOPS} moves, from {SETTLE:g} s after a browser without a graphics card has drawn the page; the device "
        "slows in its next slot, see hold_reaction_ms; a bare browser does not draw"
    )
    return of_samples(taken, FigureGoal(p99=100.0), _of_bare(bare), note)


def goal_drag_hz(stacks: Stacks) -> Figure:
    """Poses of a dragged goal that are solved and checked in a second, newest first, as from a browser at 60 Hz."""
    with opened(stacks) as twin, _chromium(twin):
        pose = twin.arm.fk(twin.arm.states["ready"])
        solver = GoalSolver(twin.arm, lambda: None)
        try:
            began = time.monotonic()
            while (now := time.monotonic() - began) < DRAG:
                solver.set_pose(pose.offset(AMPLITUDE * cos(2 * pi * now), AMPLITUDE * sin(2 * pi * now)))
                time.sleep(1.0 / 60.0)
            rate = solver.solved / DRAG
        finally:
            solver.close()
    return of_samples([rate], DRAG_GOAL, note="a circle of 20 mm in a second, beside a browser that draws")


@contextmanager
def opened(stacks: Stacks) -> Iterator[Opened]:
    """Starts all but a browser, and ends it."""
    stacks.stop()
    broker = "mosquitto" if has_mosquitto() else "embedded"
    with Stack(broker=broker, panel=True) as stack, _arm(stack) as arm:
        deployment = load_deployment(None, stack.environment)
        yield Opened(stack, arm, f"{deployment.panel.host}:{deployment.panel.port}")


@contextmanager
def _chromium(twin: Opened) -> Iterator[Page]:
    """A browser that draws the page; raises NotMeasured without Chromium."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        raise NotMeasured("there is no Chromium: apt-get install chromium")
    with (
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=program, args=FLAGS) as browser,
    ):
        page = browser.new_page(viewport=SIZE)
        page.goto(f"http://{twin.address}")
        page.get_by_role("tab").first.wait_for(timeout=1000.0 * PATIENCE)
        yield page


@contextmanager
def _arm(stack: Stack) -> Iterator[gemelo.Arm]:
    """Armed and referenced."""
    deployment = load_deployment(None, stack.environment)
    robot = gemelo.Robot(deployment, load_arm(project_root() / deployment.robot))
    with gemelo.connect(robot, name="bench_page", timeout=10.0) as arm:
        arm.device.arm()
        arm.reference()
        arm.move(named="home")
        yield arm


def _of_bare(samples: Sequence[float]) -> dict[str, float]:
    return {"bare browser": quantile(samples, 0.5), "bare browser, p99": quantile(samples, 0.99)}


def _shares_at_rest_and_moving(twin: Opened) -> tuple[list[float], list[float]]:
    """[% of a core] in each window."""
    time.sleep(SETTLE)
    rest = _shares(twin)
    motion = twin.arm.start(named="left", speed=0.05)
    moving = _shares(twin)
    twin.arm.stop()
    with suppress(gemelo.Aborted):
        motion.wait()
    twin.arm.move(named="home")
    return rest, moving


def _shares(twin: Opened) -> list[float]:
    """[% of a core] in each window."""
    shares = []
    for _ in range(WINDOWS):
        before, began = twin.panel_cpu(), time.monotonic()
        time.sleep(WINDOW)
        shares.append(100.0 * (twin.panel_cpu() - before) / (time.monotonic() - began))
    return shares


def _lags(twin: Opened, drawn: list[float]) -> list[float]:
    """[ms] of each move; `drawn` is [s] monotonic of each message that moves the measured arm."""
    lags = []
    name = twin.arm.joint_names[0]
    for number in range(MOVES):
        moved: list[float] = []
        before = twin.arm.joints[name]

        def watch(state: JointState, before: float = before, moved: list[float] = moved) -> None:
            if not moved and abs(state.position[state.name.index(name)] - before) > UNSEEN:
                moved.append(time.monotonic())

        drawn.clear()
        heard = twin.arm.node.subscribe(gemelo.topics.JOINT_STATES, watch)
        twin.arm.move(joints={name: 0.05 * (1 + number % 2)}, speed=0.5)
        time.sleep(AFTER_MOVE)
        heard.close()
        if moved and drawn:
            lags.append(1000.0 * max(0.0, drawn[0] - moved[0]))
    return lags


def _stopped(twin: Opened, wire: StopWire, press: Callable[[], object]) -> float:
    """[ms] of one stop, on the way to whichever of two states is farther."""
    joints, states = twin.arm.joints, twin.arm.states
    away = {name: max(abs(states[name][joint] - joints[joint]) for joint in joints) for name in ("home", "left")}
    motion = twin.arm.start(named=max(away, key=lambda name: away[name]), speed=0.2)
    end = time.monotonic() + PATIENCE
    while max(map(abs, twin.arm.velocities.values())) < 1e-3 and time.monotonic() < end:
        time.sleep(0.005)
    pressed = time.monotonic()
    press()
    taken = 1000.0 * (wire.next(pressed) - pressed)
    with suppress(gemelo.Aborted):
        motion.wait()
    return taken
