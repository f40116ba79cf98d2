"""One arm of a simulation: the real services as nodes of a bus in memory, and its board."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from msgspec.structs import replace

from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.robot import Motor
from gemelo.schemas.simulation import WireConditions
from gemelo.schemas.system import NodeInfo, ParameterValue
from gemelo.tools.simulation.board import SimulatedBoard, keep_position
from gemelo.tools.simulation.memory_wire import MemoryWire
from gemelo.tools.simulation.virtual_clock import VirtualClock

EXTRAS = {"planner": "planner", "camera": "eyes", "detector": "eyes"}  # of pyproject.toml, by service
UNRECORDED: dict[str, ParameterValue] = {"record_inputs": False}  # nobody replays them, and they cost a fifth
READY = 10.0  # [s] of virtual time in which gateway and planner must be ready


class NotReady(ReasonedError):
    """The twin does not become ready; the reason is what its services say."""


class MissingPart(ReasonedError):
    """A library is not installed; the reason names the extra that has it."""


class Start(NamedTuple):
    """How the twin stands when it is switched on."""

    positions: Mapping[str, float] | None = None  # [rad] or [m] by joint; None: the reference pose
    referenced: bool = True  # the board knows where the joints stand


class ServiceNode(Node):
    """A node of a service: the clock runs it."""

    def spin(self, step: Callable[[int], object] = lambda now: None, rate: float = 50.0) -> None:
        """Returns at once; the node goes on, at `rate` [Hz], until it is closed."""
        self.begin(step, rate)


class Twin:
    """Services, wire and board of one arm; files only below `folder`."""

    def __init__(
        self,
        clock: VirtualClock,
        arm: ArmDescription,
        deployment: Deployment,
        folder: Path,
        *,
        start: Start = Start(),  # noqa: B008 a tuple
        motors: Sequence[Motor] = (),
        wire: WireConditions = WireConditions(),  # noqa: B008 frozen
        log_level: str = "error",
    ) -> None:
        self.clock, self.arm = clock, arm
        self.deployment = _within(deployment, folder)
        self.network = MemoryNetwork(clock)
        self.wire = MemoryWire(clock, wire)
        self._log_level = log_level
        self._nodes: list[ServiceNode] = []
        run = Path(self.deployment.paths.run)
        keep_position(run, arm, start.positions, start.referenced)
        self.board = SimulatedBoard(arm, run, clock, self.wire, motors)
        try:
            self._serve("state_publisher")
            self._serve("planner")
            self._serve("stepper_gateway", open_wire=lambda _deployment, _arm, wake: self.wire.link(wake))
            if self.deployment.cell:
                self._serve("camera")
                self._serve("detector")
            self._await_ready()
        except BaseException:
            self.close()
            raise

    def bus(self) -> MemoryBus:
        """Another connection to the arm's bus."""
        return MemoryBus(self.network)

    def close(self) -> None:
        """Ends the services, the last that was started first."""
        while self._nodes:
            self._nodes.pop().close()
        self.board.close()

    def _serve(self, name: str, **outside: Any) -> None:
        """Runs the shell of a service; `outside` is what it would have from the world."""
        run = _shell(name).run
        node = ServiceNode(
            name, self.deployment, self.arm.name, self.bus(), log_level=self._log_level, stop=ShutdownRequest()
        )
        self._nodes.append(node)
        run(node, self.deployment, **outside)

    def _await_ready(self) -> None:
        def are_ready() -> bool:
            return all(node.is_ready for node in self._nodes)

        if not self.clock.wait_until(are_ready, READY):
            problems = [_problem(node.info()) for node in self._nodes if not node.is_ready]
            raise NotReady(because("lost.simulated", *problems, robot=self.arm.name, time=READY))
        self.clock.sleep(device_config(self.arm).enable_lead_ms * 1e-3)  # the drivers have just been switched on


def _within(deployment: Deployment, folder: Path) -> Deployment:
    """The same twin with files of its own below `folder`, where taught points and programs are copies."""
    paths = PathsSection(run=str(folder / "run"), out=str(folder / "out"), programs=str(folder / "programs"))
    if Path(deployment.paths.programs).is_dir():
        shutil.copytree(deployment.paths.programs, paths.programs)
    parameters = {node: UNRECORDED | deployment.parameters.get(node, {}) for node in ("stepper_gateway", "planner")}
    return replace(
        deployment,
        paths=paths,
        router=RouterSection(host="127.0.0.1", port=0),
        parameters={**deployment.parameters, **parameters},
    )


def _problem(info: NodeInfo) -> Reason:
    return because("lost.simulated.node", info.why or plain(info.problem), node=info.node)


def _shell(name: str) -> Any:
    """The module of a service's shell; raises `MissingPart` where a library is not installed."""
    try:
        return import_module(f"gemelo.services.{name}.main")
    except ModuleNotFoundError as error:
        extra = EXTRAS.get(name, "")
        part = {"library": str(error.name), "service": name}
        raise MissingPart(
            because("extra.simulated", extra=extra, **part) if extra else because("extra.simulated.part", **part)
        ) from error
