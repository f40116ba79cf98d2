"""The figure of many arms on one router and one broker: how many, at what CPU and lag, and where the limit lies.

An arm here is its stepper_gateway and its virtual device as processes of their own, standing, with their states at
50 Hz from the device over MQTT through the gateway to one client on the bus. Left out: planner, state_publisher,
logger, views, and motion.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

import psutil

from gemelo.libraries.runtime.bus.interface import Arrival
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import decode
from gemelo.schemas.topics import JOINT_STATES
from gemelo.tools.bench.figures import Figure, NotMeasured, quantile, rounded
from gemelo.tools.bench.stack import cpu_seconds, has_mosquitto, rss_mb
from gemelo.tools.stack.stack import free_ports

COUNTS = (1, 2, 4, 8, 12, 16, 20, 24, 32, 40, 50)
ROBOT = "urdf/rm1"
RATE = JOINT_STATES.rate or 50.0  # [Hz]
FEWEST = 0.95  # of an arm's states in the window, below which it is not carried
LATEST = 0.1  # [s] that one state in a hundred may be late: a fifth of the silence after which a device holds
SETTLE, WINDOW = 3.0, 8.0  # [s]
READY = 60.0  # [s] for what is started at once
CORES, USABLE = 16, 0.8  # of the host that is calculated, and the share of it that may be used: chosen
AS_IN_MOTION = ("--set", f"rest_rate={RATE:g}", "--set", f"readings_rest_rate={RATE:g}")
GATEWAY, DEVICE = "gemelo.services.stepper_gateway.main", "gemelo.services.virtual_esp32.main"


@dataclass
class StandingArm:
    """One arm's processes, and what the client has heard of it."""

    name: str
    run: Path
    processes: list[psutil.Process] = field(default_factory=list)  # gateway, device
    lags: list[float] = field(default_factory=list)  # [s] of each state, from its measurement to the client

    def on_arrival(self, arrival: Arrival) -> None:
        self.lags.append((time.time_ns() - decode(JointState, arrival.payload).stamp) * 1e-9)

    @property
    def is_ready(self) -> bool:
        return (self.run / "stepper_gateway.ready").exists()


@dataclass(frozen=True)
class Load:
    """What so many arms cost, each CPU time in % of one core."""

    arms: int
    slowest: float  # [Hz] of the arm with the fewest states
    lag: float  # [s] median
    late: float  # [s] 99th percentile of all arms' states
    latest: float  # [s] the same of the arm whose states are latest
    gateway: float  # CPU of one
    device: float  # CPU of one
    router: float  # CPU, of all arms
    broker: float  # CPU, of all arms
    memory: float  # [MB] of one arm
    machine: float  # CPU of everything on the machine

    @property
    def is_carried(self) -> bool:
        return self.slowest >= FEWEST * RATE and self.latest <= LATEST

    @property
    def of_one_arm(self) -> float:
        """[%] of a core for each arm."""
        return self.gateway + self.device + (self.router + self.broker) / self.arms


class ArmsOnOneRouter:
    """A router, a mosquitto, a client on the bus, and as many arms as are asked for."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._closing = ExitStack()
        self._router_port, mqtt = free_ports(2)
        self._environment = {
            "GEMELO_ROUTER_PORT": str(self._router_port), "GEMELO_MQTT_PORT": str(mqtt),
            "GEMELO_MQTT_BROKER": "mosquitto", "GEMELO_DEVICE": "virtual", "GEMELO_WIRE": "mqtt",
        }  # fmt: skip
        self.arms: list[StandingArm] = []

    def __enter__(self) -> ArmsOnOneRouter:
        with ExitStack() as opened:
            self._closing = opened
            run = self._folder / "run"
            self._common = [
                self._start(module, run) for module in ("gemelo.services.router.main", "gemelo.services.broker.main")
            ]
            _wait(lambda: all((run / f"{name}.ready").exists() for name in ("router", "broker")), "router and broker")
            self._bus = opened.enter_context(closing(ZenohBus(RouterSection(port=self._router_port), "")))
            self._closing = opened.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        self._closing.close()

    def grow(self, count: int) -> None:
        """Starts arms until there are `count`; raises `NotMeasured` where they do not become ready."""
        new = [self._arm(f"a{number:02}") for number in range(len(self.arms), count)]
        self.arms += new
        _wait(lambda: all(arm.is_ready for arm in new), f"{count} arms")

    def load(self) -> Load:
        """What the arms cost during WINDOW, and how late their states are."""
        time.sleep(SETTLE)
        arms, parts = self.arms, [arm.processes for arm in self.arms]
        groups = [[each[0] for each in parts], [each[1] for each in parts], *([each] for each in self._common)]
        for arm in arms:
            arm.lags.clear()
        psutil.cpu_percent()
        before, began = [cpu_seconds(group) for group in groups], time.monotonic()
        time.sleep(WINDOW)
        took, machine = time.monotonic() - began, psutil.cpu_percent() * psutil.cpu_count()
        gateway, device, router, broker = (
            100.0 * (cpu_seconds(group) - start) / took for group, start in zip(groups, before, strict=True)
        )
        late = [quantile(list(arm.lags) or [READY], 0.99) for arm in arms]
        lags = [lag for arm in arms for lag in tuple(arm.lags)]
        return Load(
            arms=len(arms), slowest=min(len(arm.lags) for arm in arms) / took, lag=quantile(lags or [READY], 0.5),
            late=quantile(lags or [READY], 0.99), latest=max(late), gateway=gateway / len(arms),
            device=device / len(arms),
            router=router, broker=broker, memory=sum(map(rss_mb, parts)) / len(arms), machine=machine,
        )  # fmt: skip

    def _arm(self, name: str) -> StandingArm:
        arm = StandingArm(name, self._folder / name / "run")
        robot = _robot(self._folder / name / "robot", name)
        arm.processes = [self._start(module, arm.run, robot) for module in (GATEWAY, DEVICE)]
        self._bus.subscribe(f"{name}/{JOINT_STATES.key}", JOINT_STATES.delivery, arm.on_arrival, lambda missed: None)
        return arm

    def _start(self, module: str, run: Path, robot: Path | str = ROBOT) -> psutil.Process:
        paths = {"GEMELO_PATHS_RUN": str(run), "GEMELO_PATHS_OUT": str(run.parent / "out"), "GEMELO_ROBOT": str(robot)}
        process = subprocess.Popen(
            [sys.executable, "-m", module, *(AS_IN_MOTION if module == GATEWAY else ())],
            cwd=project_root(), env=os.environ | self._environment | paths,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        self._closing.callback(process.wait)
        self._closing.callback(process.kill)
        return psutil.Process(process.pid)


def arms_on_one_router(counts: Sequence[int] = COUNTS) -> Figure:
    """The largest of `counts` arms whose states all come at 50 Hz and in time, on this machine as it is now."""
    loads = list(loads_of(counts))
    carried = [load for load in loads if load.is_carried]
    if not carried:
        raise NotMeasured(f"not even {loads[0].arms} arms are carried: {_sentence(loads[0])}")
    most = carried[-1]
    by_cores = CORES * 100.0 * USABLE / most.of_one_arm
    by_broker = 100.0 * USABLE * most.arms / most.broker if most.broker else float("inf")
    reference = {
        "CPU of a gateway [% of one core]": most.gateway, "CPU of a virtual device": most.device,
        "CPU of the router for each": most.router / most.arms, "CPU of the broker for each": most.broker / most.arms,
        "lag median [ms]": most.lag * 1e3, "lag p99 [ms]": most.late * 1e3,
        "lag p99 of the latest arm [ms]": most.latest * 1e3, "memory of an arm [MB]": most.memory,
        f"calculated for {CORES} cores": float(int(min(by_cores, by_broker))),
    }  # fmt: skip
    beyond = [_sentence(load) for load in loads if load.arms > most.arms]
    note = (
        "gateway and virtual device of each, standing, states at 50 Hz to one client; "
        + (f"beyond: {beyond[0]}; " if beyond else "more were not tried; ")
        + f"the machine's CPU then {most.machine:.0f} % of {psutil.cpu_count()} x 100; calculated: {USABLE:.0%} of "
        f"{CORES} cores, or of the one that mosquitto uses ({by_broker:.0f} arms)"
    )
    values = {what: rounded(value) for what, value in reference.items()}
    return Figure(median=float(most.arms), p99=float(most.arms), reference=values, note=note)


def loads_of(counts: Sequence[int]) -> list[Load]:
    """The load of each count, up to the first that is not carried; raises `NotMeasured` without mosquitto."""
    if not has_mosquitto():
        raise NotMeasured("mosquitto is not installed: apt-get install mosquitto")
    loads: list[Load] = []
    with tempfile.TemporaryDirectory(prefix="gemelo-arms-") as folder, ArmsOnOneRouter(Path(folder)) as site:
        for count in counts:
            site.grow(count)
            loads.append(site.load())
            print(f"  {_sentence(loads[-1])}", flush=True)
            if not loads[-1].is_carried:
                break
    return loads


def _robot(folder: Path, name: str) -> Path:
    """The robot's folder with another name of arm and device; the rest are links to it."""
    source = project_root() / ROBOT
    folder.mkdir(parents=True)
    for file in source.iterdir():
        if file.name != "robot.toml":
            (folder / file.name).symlink_to(file)
    text = (source / "robot.toml").read_text(encoding="utf-8")
    (folder / "robot.toml").write_text(text.replace('name = "rm1"', f'name = "{name}"'), encoding="utf-8")
    return folder


def _sentence(load: Load) -> str:
    return (
        f"{load.arms} arms: {load.slowest:.1f} states a second of the slowest, lag {load.lag * 1e3:.1f} ms, p99 "
        f"{load.late * 1e3:.1f} ms, of the latest arm {load.latest * 1e3:.1f} ms, "
        f"{load.of_one_arm:.1f} % of a core each"
    )


def _wait(is_true: Callable[[], bool], what: str) -> None:
    end = time.monotonic() + READY
    while not is_true():
        if time.monotonic() > end:
            raise NotMeasured(f"{what} were not ready within {READY:g} s")
        time.sleep(0.05)
