"""The page's whole server upon a bus in memory: a gateway that says what it is told to, and time that is made."""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any
from unittest import mock

import gemelo
from gemelo.api.session import Session
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime import topics
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.deployment import load_deployment
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.device import (
    DeviceCommandResponse,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    DeviceStopRequest,
)
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.planning import FkRequest, FkResponse, PlanCode
from gemelo.schemas.scene import PlanningScene
from gemelo.schemas.topics import DEVICE_STATE, DEVICE_STATUS, DEVICE_STOP, FK, JOINT_STATES, SCENE, STEP_ERRORS
from gemelo.services.panel.main import TEXTS, Panel
from gemelo.services.planner.request.refusals import stale_state
from gemelo.services.planner.request.start_state import STALE_AFTER
from gemelo.tools.bench.bare_browser import BareBrowser, Said, bare_browser
from tests.runtime.support import free_port, spinning, until

ROOT = Path(__file__).parents[2]


class Gateway:
    """Says where the arm is, and hears stops."""

    def __init__(self, node: Node, planner: Node, arm: ArmDescription) -> None:
        self.stops: list[DeviceStopRequest] = []
        self.round_trip_age = 0.0  # [s]
        self.joints = {joint.name: joint.clamp(0.1) for joint in arm.joints}
        self.node, self._arm = node, arm
        self._states, self._errors = node.publisher(JOINT_STATES), node.publisher(STEP_ERRORS)
        self._device = node.publisher(DEVICE_STATE)
        node.publisher(DEVICE_STATUS).put(DeviceStatus(online=True, device="test", virtual=True))
        self._scene = planner.publisher(SCENE)
        node.serve(DEVICE_STOP, self._on_stop)
        node.serve(FK, self._on_fk)

    def show_scene(self, scene: PlanningScene) -> None:
        """As the planner does."""
        self._scene.put(scene)

    def say(self) -> None:
        """One state of everything."""
        names, now = self._arm.joint_names, self.node.now()
        still = (0.0,) * len(names)
        self._states.put(JointState(stamp=now, name=names, position=tuple(self.joints.values()), velocity=still))
        self._errors.put(StepErrors(stamp=now, name=names, error=still))
        self._device.put(
            DeviceState(
                stamp=now,
                mode=DeviceMode.IDLE,
                armed=True,
                referenced=(True,) * len(names),
                name=names,
                steps=(0,) * len(names),
                velocity=still,
                round_trip=0.002 + 0.0003 * (now // 1_000_000 % 5),  # as measured: never twice the same
                round_trip_age=self.round_trip_age,
                speed=1.0,
            )
        )

    def _on_stop(self, request: DeviceStopRequest) -> DeviceCommandResponse:
        self.stops.append(request)
        return DeviceCommandResponse(accepted=True, mode=DeviceMode.IDLE)

    def _on_fk(self, request: FkRequest) -> FkResponse:
        """As a planner that has got no joint state yet: of all joints or of none."""
        if len(request.name) < len(self._arm.joints):
            stale = stale_state(None, STALE_AFTER)
            return FkResponse(code=stale.code, refusal=stale.refusal)
        pose = Transform(translation=(0.3, 0.0, 0.2), rotation=(0.0, 0.0, 0.0, 1.0))
        return FkResponse(code=PlanCode.SUCCESS, links=(self._arm.tool_frame,), poses=(pose,))


class MemoryPage:
    """The panel, drawn by hand, and a browser that looks at it."""

    def __init__(self, panel: Panel, gateway: Gateway, port: int) -> None:
        self.panel, self.gateway, self.port = panel, gateway, port
        self.now = time.monotonic()  # [s] as the panel is told
        self.said: Counter[str] = Counter()  # messages that the browser got, by their class
        self._marks: set[str] = set()
        self._number = count()
        self.browser: BareBrowser | None = None

    def hear(self, said: Said, at: float) -> None:
        """Counts it, or takes it for a mark of the test's own."""
        name = str(said.get("name", ""))
        if name.startswith("/mark/"):
            if said["type"] == "FrameMessage":
                self._marks.add(name)
        else:
            self.said[said["type"]] += 1

    def draw(self, texts: int = 1) -> None:
        """Pictures, each with its texts, while the arm is where the gateway says."""
        bus = self.panel.operator.bus
        for _ in range(texts):
            assert until(lambda: bus.joints == self.gateway.joints)
            self.now += 1.001 / TEXTS  # rounding may else leave a picture without its texts
            self.panel.draw(self.now)

    def sent(self) -> Counter[str]:
        """What the browser has got since the last call: all that was sent before this one."""
        [page] = self.panel.pages()
        names = {f"/mark/{next(self._number)}", f"/mark/{next(self._number)}"}
        for scene, name in zip((self.panel.server.scene, page.client.scene), names, strict=True):
            scene.add_frame(name, show_axes=False)
        assert until(lambda: names <= self._marks, 20.0)
        said, self.said = self.said, Counter()
        return said


def age(latest: topics.Latest[Any], now: int | None = None) -> float:
    """What has come is as new as ever."""
    return float("inf") if latest.message is None else 0.0


@contextmanager
def memory_page(robot: str | Path, folder: Path) -> Iterator[MemoryPage]:
    """A page of the robot, one of ours by its name or another's folder, with one browser that has got all of it."""
    port, of_robot = free_port(), ROOT / "urdf" / robot
    deployment = load_deployment(
        environ={
            "GEMELO_PATHS_RUN": str(folder / "run"),
            "GEMELO_PATHS_PROGRAMS": str(folder / "programs"),
            "GEMELO_PANEL_PORT": str(port),
            "GEMELO_ROBOT": str(of_robot),
        }
    )
    network, arm = MemoryNetwork(), load_arm(of_robot)
    with (
        Node("stepper_gateway", deployment, bus=MemoryBus(network), robot=arm.name) as node,
        Node("planner", deployment, bus=MemoryBus(network), robot=arm.name) as planner,
    ):
        gateway = Gateway(node, planner, arm)
        with (
            mock.patch.object(topics.Latest, "age", age),  # what is said does not grow old on a machine under load
            spinning(node, lambda now: gateway.say()),
            gemelo.Arm(Session(deployment, arm, Node("panel", deployment, arm.name, MemoryBus(network)))) as connected,
        ):
            panel = Panel(connected, deployment, logging.getLogger("page"))
            page = MemoryPage(panel, gateway, port)
            try:
                with bare_browser(f"127.0.0.1:{port}", page.hear) as page.browser:
                    assert until(lambda: bool(panel.pages()), 20.0)
                    yield page
            finally:
                panel.close()
