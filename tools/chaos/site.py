"""The site: a stack of its own with a slow link before its broker, an arm on it, and strangers on both buses."""

from __future__ import annotations

import os
import re
import shutil
import signal
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from functools import cached_property
from pathlib import Path
from types import TracebackType

import gemelo
from gemelo.firmware.platform.host.slot_record import VARIABLE
from gemelo.libraries.arm.cell.cell_file import deployed_cell
from gemelo.libraries.runtime.actions.keys import goal_request
from gemelo.libraries.runtime.deployment import deployment_file, load_deployment, project_root
from gemelo.libraries.runtime.saved_parameters import SavedParameters
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.deployment import Deployment, Wire
from gemelo.schemas.message import BadMessage, decode
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.system import Exchange
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, exchange_topic
from gemelo.services.broker import mosquitto
from gemelo.services.broker.replacement import NotInstalled
from gemelo.tools.chaos.clocks import ClockError, SteppingClocks
from gemelo.tools.chaos.noisy_line import NoisyLine
from gemelo.tools.chaos.person import Person
from gemelo.tools.chaos.slots import SlotFile, steps_in
from gemelo.tools.chaos.slow_link import SlowLink
from gemelo.tools.chaos.small_disk import SmallDisk, may_mount
from gemelo.tools.chaos.strangers import BusStranger, WireStranger
from gemelo.tools.chaos.twins import TwinClient, TwinProcess
from gemelo.tools.stack.stack import PROCESSES, Stack, StackError, free_ports

EYES = ("camera", "detector")
KEPT_GOALS = 20  # that can be sent again
TO_CONNECT = 30.0  # [s] for the arm to be there
TO_RECORD = 3.0  # [s] for the gateway to publish a goal that it was sent
TO_RESTART = 20.0  # [s] for a process to run again, on a busy machine
STANDS = 0.3  # [s] without a step: the arm stands
CONFIG = "deployment.toml"  # the deployment of the stack, in the folder of the results
VIRTUAL_LINE = "virtual_esp32.tty"


def program(process: str) -> str:
    """What is in the command line of a process of the stack."""
    return f"gemelo-{process.replace('_', '-')}"


def installed_broker() -> str:
    """mosquitto, or the embedded broker where mosquitto is not installed."""
    with suppress(NotInstalled):
        mosquitto.find()
        return "mosquitto"
    return "embedded"


def cell_of(deployment: Deployment) -> str:
    """The file of the cell around the arm: the deployment's, else the robot's own; empty where there is none."""
    own = f"{deployment.robot}/cell.toml"
    return deployment.cell or (own if (project_root() / own).is_file() else "")


def with_wire(deployment: str, wire: Wire) -> str:
    """The text of a deployment file with this wire."""
    line = f'wire = "{wire}"'
    changed, count = re.subn(r"^wire\s*=.*$", line, deployment, count=1, flags=re.MULTILINE)
    return changed if count else f"{line}\n{deployment}"


def processes_of(deployment: Deployment) -> tuple[str, ...]:
    """What runs in chaos: everything, but for those that have nothing to do without a cell."""
    return tuple(name for name in PROCESSES if name not in EYES or cell_of(deployment))


class ChaosSite:
    """Starts on entering, stops on leaving; `out` gets recordings and logs.

    `is_judged`: `processes_of` the deployment run, clocks can step, and `out` gets the slots of the device; else only
    what a move needs, and what records and draws it. Raises `StackError` where it cannot.
    """

    def __init__(self, out: Path, broker: str, seed: int, is_judged: bool = True) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self._config, self._wire = out / CONFIG, Wire.MQTT
        self._deployment = deployment_file(None, os.environ).read_text(encoding="utf-8")
        self._config.write_text(with_wire(self._deployment, self._wire), encoding="utf-8")
        self.line: NoisyLine | None = None  # while the wire is a serial line
        self.twin: TwinProcess | None = None  # while there are two of one process
        self.twin_client: TwinClient | None = None  # while there are two of one client of the broker
        self.motion: gemelo.Motion  # of this episode
        self.found: list[Reason] = []  # what the injections of this episode saw themselves and must not be
        self.slots = SlotFile(out / "slots")
        self._out = out
        self._port, self.broker_port = free_ports(2)
        self.stack = Stack(
            broker=broker,
            viewer="web" if is_judged else "none",
            panel=is_judged,
            out=out,
            environment={
                "GEMELO_MQTT_PORT": str(self._port),
                "GEMELO_MQTT_LISTEN_PORT": str(self.broker_port),
                "GEMELO_DEVICE": "virtual",
                "GEMELO_WIRE": "",  # as its file says, which `use_wire` writes
                "GEMELO_CONFIG": str(out / CONFIG),
                **(self._judged() if is_judged else {}),
            },
        )
        self.disk: SmallDisk | None = None  # of the run folder alone, while the site stands; only root may mount one
        self._keep_all_recordings()
        self._seed = seed
        self._goals: dict[str, GoalRequest] = {}  # by id, the newest last
        self._closing = ExitStack()

    def _judged(self) -> dict[str, str]:
        cell = cell_of(load_deployment())
        return {VARIABLE: str(self.slots.path), **self.clocks.environment, **({"GEMELO_CELL": cell} if cell else {})}

    @cached_property
    def clocks(self) -> SteppingClocks:
        """Of all that may run; made when first asked for, since that takes a compiler. Raises `StackError`."""
        try:
            return SteppingClocks(self._out, [*map(program, PROCESSES), "mosquitto"])  # which takes a broker's place
        except ClockError as error:
            raise StackError(error.reason) from error

    def __enter__(self) -> ChaosSite:
        with ExitStack() as closing:
            self.link = SlowLink(self._port, self.broker_port, self._seed)
            closing.callback(self.link.close)
            if may_mount():
                closing.callback(shutil.rmtree, self.stack.folder, ignore_errors=True)  # after the disk has gone
                self.disk = closing.enter_context(SmallDisk(self.stack.run))
                self._keep_all_recordings()
            closing.enter_context(self.stack)
            os.environ.update(self.stack.deployment)  # where the arm is found
            self.arm = closing.enter_context(self._connect())
            self.arm.node.subscribe(exchange_topic(goal_request(FOLLOW_JOINT_TRAJECTORY)), self._note_goal)
            closing.callback(self._close_line)
            closing.callback(self._end_twins)
            self.wire = WireStranger(self.broker_port)
            closing.callback(self.wire.close)
            cameras = deployed_cell(load_deployment()).camera_names
            self.bus = BusStranger(int(self.stack.deployment["GEMELO_ROUTER_PORT"]), self.arm.name, cameras)
            closing.callback(self.bus.close)
            self._closing = closing.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    @cached_property
    def person(self) -> Person:
        """Beside the arm from the first look on."""
        return Person(self.arm)

    def pause(self, seconds: float) -> None:
        """Lets time [s] pass."""
        self.arm.wait_for(lambda: False, seconds)

    def steps_since(self, offset: int) -> int:
        """In how many slots there was a step since the record of slots had `offset` [bytes]."""
        return steps_in(self.slots.rows(offset))

    def stands_within(self, seconds: float) -> bool:
        """Waits until the device has made no step for 0.3 s; False if it still makes some after `seconds` [s]."""
        end = self.arm.node.monotonic() + seconds
        while True:
            before = self.slots.size
            self.pause(STANDS)
            if not self.steps_since(before):
                return True
            if self.arm.node.monotonic() > end:
                return False

    def end_twin(self, judge: Callable[[TwinProcess], list[Reason]]) -> list[Reason]:
        """Ends the second process, if there is one; what `judge` has found of it before."""
        twin, self.twin = self.twin, None
        if twin is None:
            return []
        try:
            return judge(twin)
        finally:
            twin.end()

    def _end_twins(self) -> None:
        self.end_twin(lambda twin: [])
        if self.twin_client is not None:
            self.twin_client.close()

    def take_found(self) -> list[Reason]:
        """What the injections saw themselves since the last call."""
        found, self.found = self.found, []
        return found

    def recorded_goal(self) -> GoalRequest:
        """The request that began this episode's motion, as the gateway has published it; raises `StackError`."""
        goal_id = self.motion.goal_id
        if not self.arm.wait_for(lambda: goal_id in self._goals, TO_RECORD):
            raise StackError(because("chaos.goal_unpublished", goal=goal_id, time=TO_RECORD))
        return self._goals[goal_id]

    def restart(self, name: str) -> None:
        """SIGTERM, and waits until process-compose has started it again; raises `StackError` where it has not."""
        before = self.stack.kill(name, signal.SIGTERM)
        end = time.monotonic() + TO_RESTART
        while (pid := self.stack.pid(name)) in (0, before):
            if time.monotonic() > end:
                raise StackError(because("chaos.not_restarted", name=name, pid=before or pid, time=TO_RESTART))
            self.pause(0.05)

    def use_wire(self, wire: Wire) -> None:
        """The link between gateway and device from now on; both start anew where it is another. Raises `StackError`."""
        if wire is self._wire:
            return
        self._close_line()
        self._wire = wire
        self._config.write_text(with_wire(self._deployment, wire), encoding="utf-8")
        self.restart("virtual_esp32")
        if wire is Wire.SERIAL:
            self.line = self._line()
        self.restart("stepper_gateway")
        self.stack.wait_ready(TO_RESTART, ("virtual_esp32", "stepper_gateway"))

    def _line(self) -> NoisyLine:
        """In the place of the device's own line, once that is there."""
        path = self.stack.run / VIRTUAL_LINE
        end = time.monotonic() + TO_RESTART
        while True:
            try:
                return NoisyLine(path, self._seed)
            except OSError as error:
                if time.monotonic() > end:
                    why = because("chaos.line_late", file=str(path), time=TO_RESTART, error=str(error))
                    raise StackError(why) from error
            self.pause(0.05)

    def _close_line(self) -> None:
        line, self.line = self.line, None
        if line is not None:
            line.close()

    def _note_goal(self, exchange: Exchange) -> None:
        with suppress(BadMessage):
            request = decode(GoalRequest, bytes(exchange.question))
            self._goals[request.goal_id] = request
        while len(self._goals) > KEPT_GOALS:
            del self._goals[next(iter(self._goals))]

    def _keep_all_recordings(self) -> None:
        """None is removed: all are judged at the end."""
        SavedParameters(self.stack.run, "logger").keep({"keep_files": 0})

    def _connect(self) -> gemelo.Arm:
        """Raises `StackError` with the reason of each process that is not ready."""
        try:
            return gemelo.connect(name="chaos", timeout=TO_CONNECT)
        except gemelo.Error as error:
            unready = self.stack.why_not_ready()
            lines = (plain(str(each)) for each in unready)
            raise StackError(because("chaos.no_arm", error.message, *lines), unready) from error
