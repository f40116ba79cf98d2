"""`gemelo doctor`: what keeps a twin from working here, each with its remedy."""

from __future__ import annotations

import os
import platform
import shutil
import socket
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path

import msgspec

from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt.access import gateway_access
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.libraries.runtime.deployment import project_root, when_silent
from gemelo.libraries.runtime.process.priority import may_step_ahead
from gemelo.libraries.runtime.process.unwritten import remedy_of
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.deployment import Deployment, MqttSection, RouterSection, Wire
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.device_faults import fault_text
from gemelo.schemas.device_link import offline_text, state_round_trip_text
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.system import NodeInfo
from gemelo.schemas.topics import DEVICE_STATE, DEVICE_STATUS
from gemelo.tools.cli.bus.node import TIMEOUT, living
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options
from gemelo.tools.cli.version import gemelo_version, version_text

BROKER_PAGE = "docs/my_broker.md has every such sentence with what to do"
# Tuning constants: chosen.
LEAST_DISK = 1e9  # [bytes] free: an hour of recordings
LEAST_DESCRIPTORS = 8  # free ones of a process: a connection to a broker takes three
FILE = 16_384  # [bytes] of a file that is tried: more than any of a run's has
LEAST_MEMORY = 5e8  # [bytes] free: what the stack needs itself
MOST_CPU = 85.0  # [%] of all cores: above it, ticks of a virtual device come late
CPU_OVER = 1.0  # [s]
LISTENING = 1.5  # [s] for what the nodes say
MOST_SKEW = 0.5  # [s] between this host's clock and a node's


class Verdict(StrEnum):
    """Of one check."""

    OK = "ok"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True)
class Diagnosis:
    """What was looked at, what was found, and what would do."""

    verdict: Verdict
    subject: str
    found: str
    remedy: str = ""


def run(options: Options) -> ExitCode:
    """Prints every diagnosis; FAILED if one of them is an error."""
    found = list(diagnoses())
    if options.json:
        print(msgspec.json.encode([asdict(each) for each in found]).decode())
    else:
        print(table(("", "what", "found"), [(each.verdict.value, each.subject, each.found) for each in found]))
        for each in found:
            if each.remedy:
                print(f"{each.subject}: {each.remedy}")
    return ExitCode.FAILED if any(each.verdict is Verdict.ERROR for each in found) else ExitCode.OK


def diagnoses() -> Iterator[Diagnosis]:
    """Of this machine, then of the deployment, then of the twin where it runs."""
    yield Diagnosis(Verdict.OK, "versions", f"{version_text()}, {platform.system()} {platform.machine()}")
    yield from _machine()
    try:
        deployment = deployment_here()
    except ConfigurationError as error:
        yield Diagnosis(Verdict.ERROR, "deployment", str(error), "correct the file that $GEMELO_CONFIG names")
        return
    yield from _folders(deployment)
    yield _robot(deployment)
    if not _has_gateway(deployment):
        yield Diagnosis(Verdict.OK, "wire", "the gateway is on another host of the site, and the device's wire with it")
    elif deployment.wire is Wire.SERIAL:
        yield serial_port(deployment.serial.device)
    else:
        yield broker(deployment.mqtt)
    router = _listener("router", deployment.router.host, deployment.router.port)
    yield router
    if router.verdict is Verdict.OK:
        yield from runs(deployment.router)
        yield from _twin()


def deployment_here() -> Deployment:
    """That of the robot that runs; where several do and none is chosen, that of this folder."""
    from gemelo.libraries.runtime.running import SeveralRobots, find_deployment  # slow to load: the bus

    try:
        return find_deployment()
    except SeveralRobots:
        return load_started()


def runs(router: RouterSection) -> Iterator[Diagnosis]:
    """Every robot on the router, and the files that its twin was started with."""
    from gemelo.libraries.runtime.running import ask_files, running_robots  # slow to load: the bus

    for robot, nodes in sorted(running_robots(router).items()):
        info = ask_files(router, robot, nodes)
        if info is None:
            found = f"{len(nodes)} nodes are alive, and none says what it was started with"
            yield Diagnosis(Verdict.WARNING, f"runs {robot}", found, "`gemelo node list` says which do not answer")
        else:
            cell = f"with {info.files.cell}" if info.files.cell else "without a cell"
            yield Diagnosis(Verdict.OK, f"runs {robot}", f"{info.files.robot} on {info.host}, {cell}")


def _has_gateway(deployment: Deployment) -> bool:
    """False on a host of a site whose gateway runs elsewhere: only that one's host has its certificate."""
    return not deployment.router.tls or Path(deployment.router.ca).with_name("gateway.pem").exists()


def _machine() -> Iterator[Diagnosis]:
    import psutil  # 20 ms

    busy, cores = psutil.cpu_percent(CPU_OVER), os.cpu_count() or 1
    found = f"{busy:.0f} % of {cores} cores in use"
    if busy > MOST_CPU:
        remedy = "end what uses it (`gemelo top` says which node): a virtual device loses time when it has to wait"
        yield Diagnosis(Verdict.WARNING, "CPU", found, remedy)
    else:
        yield Diagnosis(Verdict.OK, "CPU", found)
    yield _priority()
    memory = psutil.virtual_memory().available
    yield _enough("memory", memory, LEAST_MEMORY, "end what uses it")


def _priority() -> Diagnosis:
    """Of gateway, broker, router and virtual device; without it a twin works, as long as the machine has time left."""
    if may_step_ahead():
        return Diagnosis(Verdict.OK, "priority", "heartbeats and stops go before everything else of this machine")
    found = "heartbeats and stops wait their turn: beside much other work a device may hold for want of them"
    remedy = 'a line "<user> - rtprio 1" in /etc/security/limits.conf and a new login let them go first'
    return Diagnosis(Verdict.OK, "priority", found, remedy)


def _enough(subject: str, free: float, least: float, remedy: str) -> Diagnosis:
    found = f"{free / 1e9:.1f} GB free"
    return Diagnosis(*((Verdict.WARNING, subject, found, remedy) if free < least else (Verdict.OK, subject, found)))


def _folders(deployment: Deployment) -> Iterator[Diagnosis]:
    for name, text in (("recordings", deployment.paths.out), ("run", deployment.paths.run)):
        path = project_root() / text
        there = next(each for each in (path, *path.parents) if each.exists())
        if (error := _refusal(there)) is not None:
            found = f"{path} cannot be written ({error.strerror}): what moves and stops the arm goes on without"
            yield Diagnosis(Verdict.ERROR, f"folder {name}", found, remedy_of(error))
        elif name == "recordings":
            yield _enough("disk", shutil.disk_usage(there).free, LEAST_DISK, f"free space where {path} is")


def _refusal(folder: Path) -> OSError | None:
    """Why no file of some size can be written in the folder; None where one can. Nothing of it stays."""
    try:
        with tempfile.TemporaryFile(dir=folder, buffering=0) as file:
            file.write(bytes(FILE))
    except OSError as error:
        return error
    return None


def _robot(deployment: Deployment) -> Diagnosis:
    from gemelo.libraries.arm.checks.check import Severity, check  # half a second

    errors = [each for each in check(project_root() / deployment.robot) if each.severity is Severity.ERROR]
    if errors:
        return Diagnosis(Verdict.ERROR, "robot", str(errors[0]), f"`gemelo check {deployment.robot}` says them all")
    return Diagnosis(Verdict.OK, "robot", f"{deployment.robot} is well")


def serial_port(device: str) -> Diagnosis:
    """Whether it is there and may be opened."""
    path = Path(device)
    if not path.exists():
        return Diagnosis(Verdict.ERROR, "serial port", f"{device} is not there", "plug the board in, or name its port")
    if not os.access(path, os.R_OK | os.W_OK):
        remedy = "sudo usermod -aG dialout $USER, then log in anew"
        return Diagnosis(Verdict.ERROR, "serial port", f"{device} may not be opened", remedy)
    return Diagnosis(Verdict.OK, "serial port", device)


def _listener(name: str, host: str, port: int) -> Diagnosis:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError as error:
        found = f"nobody listens at {host}:{port} ({error.strerror or error})"
        return Diagnosis(Verdict.ERROR, name, found, when_silent(host))
    return Diagnosis(Verdict.OK, name, f"listens at {host}:{port}")


def broker(section: MqttSection) -> Diagnosis:
    """Of the broker: whether it is there, and lets the gateway in."""
    from gemelo.libraries.mqtt.check import problem  # 50 ms

    try:
        access = gateway_access(section)
    except AccessError as error:
        return Diagnosis(Verdict.ERROR, "broker", str(error), BROKER_PAGE)
    listening = _listener("broker", section.host, section.port)
    if listening.verdict is Verdict.ERROR and access.is_ours:
        return listening
    said = problem(access)
    return listening if said is None else Diagnosis(Verdict.ERROR, "broker", sentence(said), BROKER_PAGE)


def _twin() -> Iterator[Diagnosis]:
    try:
        with connect() as session:
            yield from twin(session)
    except CommandError as error:
        yield Diagnosis(Verdict.ERROR, "twin", str(error))


def twin(session: CommandSession) -> Iterator[Diagnosis]:
    """Of the nodes, the device and the clocks."""
    node = session.node
    statuses: list[DeviceStatus] = []
    states: list[DeviceState] = []
    node.subscribe(DEVICE_STATUS, statuses.append)
    node.subscribe(DEVICE_STATE, states.append)
    node.wait(LISTENING)
    nodes, up = living(session), when_silent(session.deployment.router.host)
    yield Diagnosis(Verdict.OK if nodes else Verdict.ERROR, "nodes", ", ".join(nodes) or "none", "" if nodes else up)
    yield from twins(node.twins())
    yield device(statuses[-1] if statuses else None, states[-1] if states else None, up, node.now())
    yield from warning(statuses[-1] if statuses else None)
    told = _told(session, nodes)
    yield versions({name: info for name, (info, _) in told.items()})
    yield from unwritten(info for info, _ in told.values())
    yield from descriptors(info for info, _ in told.values() if info.host == session.node.info().host)
    yield clocks({name: clock for name, (_, clock) in told.items() if clock is not None})


def twins(borne: Mapping[str, tuple[str, ...]]) -> Iterator[Diagnosis]:
    """Several nodes of one name: the older gives way by itself, unless it stands still."""
    for name, processes in borne.items():
        remedy = f"the older ends by itself within 2 s; if it does not, end {processes[0]}"
        yield Diagnosis(
            Verdict.ERROR, f"two {name}", f"{name} lives {len(processes)} times: {', '.join(processes)}", remedy
        )


def _told(session: CommandSession, nodes: Iterable[str]) -> dict[str, tuple[NodeInfo, ClockOffset | None]]:
    """What each node says of itself, and its clock."""
    from gemelo.libraries.runtime.errors import NoAnswer  # 0.1 s, for a twin that runs
    from gemelo.libraries.runtime.node_clock import ask_about

    found = {}
    for name in nodes:
        with suppress(NoAnswer):  # that it is silent, `gemelo node list` says
            found[name] = ask_about(session.node, name, TIMEOUT)
    return found


def versions(infos: Mapping[str, NodeInfo]) -> Diagnosis:
    """Whether every node runs the version of gemelo that this command is of."""
    own = gemelo_version()
    others = [f"{name} {info.version} on {info.host}" for name, info in infos.items() if info.version not in ("", own)]
    if not others:
        return Diagnosis(Verdict.OK, "versions of the nodes", f"{len(infos)} nodes run {own}, as this command")
    remedy = "put one version on every host (`make setup` there), and start its nodes anew"
    return Diagnosis(Verdict.WARNING, "versions of the nodes", f"{', '.join(others)}; this command is {own}", remedy)


def unwritten(infos: Iterable[NodeInfo]) -> Iterator[Diagnosis]:
    """What a node cannot write to its disk, with the remedies; nothing for one that can."""
    for info in infos:
        if info.unwritten:
            yield Diagnosis(Verdict.WARNING, f"files of {info.node} on {info.host}", info.unwritten)


def descriptors(infos: Iterable[NodeInfo]) -> Iterator[Diagnosis]:
    """The processes of this host that soon get no file or connection any more; those of other users are left out."""
    import psutil  # 20 ms

    for info in infos:
        with suppress(psutil.Error):
            process = psutil.Process(info.pid)
            used, most = process.num_fds(), process.rlimit(psutil.RLIMIT_NOFILE)[0]
            if most - used < LEAST_DESCRIPTORS:
                found = f"{used} are in use, its limit is {most}: a connection that breaks does not come back"
                remedy = "`ulimit -n` raises the limit for its next start; `gemelo top` shows whether it grows"
                yield Diagnosis(Verdict.WARNING, f"descriptors of {info.node}", found, remedy)


def device(status: DeviceStatus | None, state: DeviceState | None, up: str, now: int = 0) -> Diagnosis:
    """Whether it is online, and in no fault, at `now` [ns UNIX]; `up` is the remedy where no gateway speaks of it."""
    if status is None:
        return Diagnosis(Verdict.ERROR, "device", "stepper_gateway says nothing of it", up)
    if not status.online:
        remedy = "see that it has power and reaches its broker; `gemelo device status` says more"
        if status.speaks:  # the sentence has the causes, and what to do
            remedy = "docs/my_broker.md has the broker's ACL" if status.deaf_since else ""
        return Diagnosis(Verdict.ERROR, "device", offline_text(status, now), remedy)
    if state is not None and state.fault:
        return Diagnosis(
            Verdict.WARNING, "device", fault_text(state.fault), "`gemelo reset`, when a person has seen why"
        )
    trip = "" if state is None else f", {state_round_trip_text(state)}"
    return Diagnosis(Verdict.OK, "device", f"{status.device} is online{trip}")


def warning(status: DeviceStatus | None) -> Iterator[Diagnosis]:
    """What a person has to mend beside an online device: two planners, another program on the device's topics."""
    if status is not None and status.warning:
        yield Diagnosis(Verdict.WARNING, "who speaks", status.warning)


def clocks(offsets: Mapping[str, ClockOffset]) -> Diagnosis:
    """How far the clock of each node's host is from this one's; no motion depends on it."""
    if not offsets:
        return Diagnosis(Verdict.WARNING, "clocks", "no node tells its time, so they cannot be compared")
    apart = {name: each for name, each in offsets.items() if abs(each.offset) > MOST_SKEW + each.bound}
    if apart:
        found = ", ".join(f"{name} {each}" for name, each in apart.items())
        remedy = (
            "let all hosts take their time from one server (timedatectl set-ntp true): motions do not mind, but logs "
            "and recordings of several hosts are hard to lay side by side"
        )
        return Diagnosis(Verdict.WARNING, "clocks", f"against this host's: {found}", remedy)
    name = max(offsets, key=lambda each: abs(offsets[each].offset))
    return Diagnosis(
        Verdict.OK, "clocks", f"{len(offsets)} nodes; farthest from this host's is {name}, {offsets[name]}"
    )
