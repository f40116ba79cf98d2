"""The figures of the operator's page: what it costs, its lag, how soon its space bar stops, how fast a goal follows.

A browser without a graphics card draws on the same cores, so all but `goal_drag_hz` measure the machine as well.
"""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import cos, pi, sin

import psutil
import viser
from playwright.sync_api import Page, sync_playwright
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.typing import Subprotocol

import gemelo
from schemas.joints import JointState
from services.arm.model.description import load_arm
from services.bench.figures import Figure, Goal, NotMeasured, of_samples, quantile
from services.bench.stack import Stacks, has_mosquitto
from services.bench.stops import Wire
from services.panel.model.goal import GoalSolver
from services.runtime.deployment import load_deployment, project_root
from services.stack.stack import Stack

FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SIZE = {"width": 1280, "height": 720}
SETTLE, WINDOW, WINDOWS = 3.0, 2.0, 5  # [s], [s], of CPU
MOVES, STOPS = 20, 20
DRAG = 4.0  # [s]
MOVED = b"/measured/"  # in a message that draws the measured arm
AMPLITUDE = 0.02  # [m] radius of the circle that is dragged
PATIENCE = 60.0  # [s]


@dataclass
class Opened:
    """A twin with a page, one browser that shows it, and an arm that can move."""

    stack: Stack
    page: Page
    arm: gemelo.Arm
    address: str  # of the page, host and port

    def panel_cpu(self) -> float:
        """[s] that the panel's process has used."""
        times = psutil.Process(self.stack.pid("panel")).cpu_times()
        return float(times.user + times.system)


def panel_cpu_percent(stacks: Stacks) -> Figure:
    """CPU [% of a core] of the panel while the arm moves, with one browser; the reference is at rest."""
    with opened(stacks) as twin:
        time.sleep(SETTLE)
        rest = _shares(twin)
        motion = twin.arm.start(named="left", speed=0.05)
        moving = _shares(twin)
        motion.cancel()
        motion.wait()
    idle = quantile(rest, 0.5)
    note = f"{WINDOWS} windows of {WINDOW:g} s; at rest {idle:.1f} (goal 5), while it moves the goal is 15"
    return of_samples(moving, Goal(median=15.0), {"at rest": idle}, note)


def panel_lag_ms(stacks: Stacks) -> Figure:
    """From a joint state on the bus, the first that moves, to the message with it on the way to a browser [ms]."""
    with opened(stacks) as twin, _drawn(twin.address) as drawn:
        lags = []
        for number in range(MOVES):
            moved: list[float] = []
            before = twin.arm.joints

            def watch(state: JointState, before: dict[str, float] = before, moved: list[float] = moved) -> None:
                here = zip(state.name, state.position, strict=True)
                if not moved and any(abs(at - before[name]) > 1e-4 for name, at in here):
                    moved.append(time.monotonic())

            heard = twin.arm.node.subscribe(gemelo.topics.JOINT_STATES, watch)
            name = twin.arm.joint_names[0]
            twin.arm.move(joints={name: 0.05 * (1 + number % 2)}, speed=0.5)
            twin.page.wait_for_timeout(200.0)
            heard.close()
            after = [at for at in drawn if moved and at >= moved[0]]
            if after:
                lags.append(1000.0 * (after[0] - moved[0]))
    return of_samples(lags, Goal(p99=60.0), note=f"{MOVES} moves from rest, one browser without a graphics card")


def stop_key_ms(stacks: Stacks) -> Figure:
    """From the space bar to the STOP frame on the wire [ms], while the arm moves."""
    with opened(stacks) as twin:
        wire = Wire(int(twin.stack.deployment["GEMELO_MQTT_PORT"]), twin.arm.description.device.name)
        try:
            taken = [_stopped(twin, wire, number) for number in range(STOPS)]
        finally:
            wire.close()
    note = f"{STOPS} moves; the device slows in its next slot, see hold_reaction_ms"
    return of_samples(taken, Goal(p99=100.0), note=note)


def goal_drag_hz(stacks: Stacks) -> Figure:
    """Poses of a dragged goal that are solved and checked in a second, newest first, as from a browser at 60 Hz."""
    with opened(stacks) as twin:
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
    return of_samples(
        [rate], note="at least 20 is the goal; a circle of 20 mm in a second, beside a browser that draws"
    )


@contextmanager
def opened(stacks: Stacks) -> Iterator[Opened]:
    """Starts it all, and ends it; raises NotMeasured without Chromium."""
    program = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if program is None:
        raise NotMeasured("there is no Chromium: apt-get install chromium")
    stacks.stop()
    broker = "mosquitto" if has_mosquitto() else "amqtt"
    with Stack(broker=broker, panel=True) as stack, sync_playwright() as playwright:
        deployment = load_deployment(None, stack.environment)
        with playwright.chromium.launch(executable_path=program, args=FLAGS) as browser, _arm(stack) as arm:
            page = browser.new_page(viewport=SIZE)
            address = f"{deployment.panel.host}:{deployment.panel.port}"
            page.goto(f"http://{address}")
            page.get_by_role("tab").first.wait_for(timeout=1000.0 * PATIENCE)
            yield Opened(stack, page, arm, address)


@contextmanager
def _drawn(address: str) -> Iterator[list[float]]:
    """[s] monotonic, of each message that moves the measured arm, as it reaches a client beside the browser.

    The browser's own news of its messages waits until somebody asks the browser for something.
    """
    drawn: list[float] = []
    with connect(f"ws://{address}", subprotocols=[Subprotocol(f"viser-v{viser.__version__}")], max_size=None) as socket:

        def listen() -> None:
            with suppress(ConnectionClosed):
                for message in socket:
                    if isinstance(message, bytes) and MOVED in message:
                        drawn.append(time.monotonic())  # noqa: PERF401 it is read meanwhile

        threading.Thread(target=listen, daemon=True).start()
        yield drawn


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


def _shares(twin: Opened) -> list[float]:
    """[% of a core] in each window."""
    shares = []
    for _ in range(WINDOWS):
        before, began = twin.panel_cpu(), time.monotonic()
        twin.page.wait_for_timeout(1000.0 * WINDOW)
        shares.append(100.0 * (twin.panel_cpu() - before) / (time.monotonic() - began))
    return shares


def _stopped(twin: Opened, wire: Wire, number: int) -> float:
    """[ms] of one stop."""
    motion = twin.arm.start(named="left" if number % 2 else "home", speed=0.2)
    end = time.monotonic() + PATIENCE
    while max(map(abs, twin.arm.velocities.values())) < 1e-3 and time.monotonic() < end:
        time.sleep(0.005)
    pressed = time.monotonic()
    twin.page.keyboard.press("Space")
    taken = 1000.0 * (wire.next(pressed) - pressed)
    with suppress(gemelo.Aborted):
        motion.wait()
    return taken
