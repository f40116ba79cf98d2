"""`gemelo doctor`: what keeps a twin from working here, each with its remedy."""

from __future__ import annotations

import os
import platform
import shutil
import socket
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import msgspec

from gemelo.api.errors import reason_of
from gemelo.libraries.credentials.private_files import AccessError
from gemelo.libraries.mqtt.access import gateway_access
from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.libraries.runtime.deployment import project_root, remedy_when_silent
from gemelo.libraries.runtime.process.priority import may_raise_priority
from gemelo.libraries.runtime.process.unwritten import remedy_for
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.deployment import Deployment, MqttSection, RouterSection, Wire
from gemelo.schemas.device import DeviceState, DeviceStatus
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.device_link import state_round_trip, warning_of, why_not_usable
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, Remedy, because, remedy, say_apart
from gemelo.schemas.system import NodeInfo
from gemelo.schemas.topics import DEVICE_STATE, DEVICE_STATUS
from gemelo.tools.cli.bus.node import TIMEOUT, living
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.language import language, sentence
from gemelo.tools.cli.common.session import CommandSession, connect
from gemelo.tools.cli.common.text_table import table
from gemelo.tools.cli.parser import Options
from gemelo.tools.cli.version import gemelo_version, version_text

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
    """What was looked at, and what was found, with what would do."""

    verdict: Verdict
    subject: str
    why: Reason
    title: Reason | None = None  # of the subject, where that has a name in it

    @property
    def found(self) -> str:
        """In English, without what would do."""
        return say_apart(self.why)[0]

    @property
    def remedy(self) -> str:
        """What would do, in English; empty where nothing needs to be done."""
        return say_apart(self.why)[1]

    @property
    def heading(self) -> Reason:
        """The subject as data."""
        return self.title or because("doctor.title", subject=self.subject)


class Printed(msgspec.Struct, frozen=True):
    """A line of --json, the same in every language."""

    verdict: str
    subject: str
    found: str
    remedy: str
    why: Reason


def run(options: Options) -> ExitCode:
    """Prints every diagnosis; FAILED if one of them is an error."""
    found = list(diagnoses())
    if options.json:
        print(msgspec.json.encode(as_rows(found)).decode())
    else:
        print_diagnoses(found)
    return ExitCode.FAILED if any(each.verdict is Verdict.ERROR for each in found) else ExitCode.OK


def as_rows(found: Iterable[Diagnosis]) -> list[Printed]:
    """The lines of --json."""
    return [Printed(each.verdict.value, each.subject, each.found, each.remedy, each.why) for each in found]


def print_diagnoses(found: Iterable[Diagnosis]) -> None:
    """A table, and below it what would do."""
    rows, remedies = [], []
    for each in found:
        heading, (text, mended) = sentence(each.heading), say_apart(each.why, language())
        rows.append((sentence(because("doctor.title.verdict", verdict=each.verdict.value)), heading, text))
        if mended:
            remedies.append(sentence(because("doctor.line", subject=heading, text=mended)))
    titles = (sentence(because("doctor.title", subject=word)) for word in ("what", "found"))
    print(table(("", *titles), rows))
    if remedies:
        print("\n".join(remedies))


def diagnoses() -> Iterator[Diagnosis]:
    """Of this machine, then of the deployment, then of the twin where it runs."""
    here = because("doctor.versions", text=version_text(), system=platform.system(), machine=platform.machine())
    yield Diagnosis(Verdict.OK, "versions", here)
    yield from _machine()
    try:
        deployment = deployment_here()
    except ConfigurationError as error:
        yield Diagnosis(
            Verdict.ERROR, "deployment", because("doctor.deployment", error.reason, remedy("correct_config"))
        )
        return
    yield from _folders(deployment)
    yield _robot(deployment)
    if not _has_gateway(deployment):
        yield Diagnosis(Verdict.OK, "wire", because("doctor.wire_elsewhere"))
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
            why, verdict = because("doctor.runs.silent", remedy("see_which_nodes"), count=len(nodes)), Verdict.WARNING
        elif info.files.cell:
            why = because("doctor.runs.with_cell", robot=info.files.robot, host=info.host, cell=info.files.cell)
            verdict = Verdict.OK
        else:
            why, verdict = because("doctor.runs.without_cell", robot=info.files.robot, host=info.host), Verdict.OK
        yield Diagnosis(verdict, f"runs {robot}", why, because("doctor.title.runs", robot=robot))


def _has_gateway(deployment: Deployment) -> bool:
    """False on a host of a site whose gateway runs elsewhere: only that one's host has its certificate."""
    return not deployment.router.tls or Path(deployment.router.ca).with_name("gateway.pem").exists()


def _machine() -> Iterator[Diagnosis]:
    import psutil  # 20 ms

    busy, cores = psutil.cpu_percent(CPU_OVER), os.cpu_count() or 1
    is_busy = busy > MOST_CPU
    hint = (remedy("end_what_uses_cpu"),) if is_busy else ()
    why = because("doctor.cpu", *hint, busy=busy, cores=cores)
    yield Diagnosis(Verdict.WARNING if is_busy else Verdict.OK, "CPU", why)
    yield _priority()
    memory = psutil.virtual_memory().available
    yield _enough("memory", memory, LEAST_MEMORY, remedy("end_what_uses_it"))


def _priority() -> Diagnosis:
    """Of gateway, broker, router and virtual device; without it a twin works, as long as the machine has time left."""
    if may_raise_priority():
        return Diagnosis(Verdict.OK, "priority", because("doctor.priority"))
    return Diagnosis(Verdict.OK, "priority", because("doctor.priority.none", remedy("real_time_limit")))


def _enough(subject: str, free: float, least: float, hint: Remedy) -> Diagnosis:
    is_little = free < least
    why = because("doctor.free", *((hint,) if is_little else ()), free=free / 1e9)
    return Diagnosis(Verdict.WARNING if is_little else Verdict.OK, subject, why)


def _folders(deployment: Deployment) -> Iterator[Diagnosis]:
    for name, text in (("recordings", deployment.paths.out), ("run", deployment.paths.run)):
        path = project_root() / text
        there = next(each for each in (path, *path.parents) if each.exists())
        if (error := _refusal(there)) is not None:
            why = because("doctor.folder", remedy_for(error), path=str(path), error=str(error.strerror))
            yield Diagnosis(Verdict.ERROR, f"folder {name}", why, because("doctor.title.folder", folder=name))
        elif name == "recordings":
            hint = remedy("free_space", path=str(path))
            yield _enough("disk", shutil.disk_usage(there).free, LEAST_DISK, hint)


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
        hint = remedy("check_robot", robot=deployment.robot)
        return Diagnosis(Verdict.ERROR, "robot", because("doctor.robot.wrong", errors[0].reason, hint))
    return Diagnosis(Verdict.OK, "robot", because("doctor.robot", robot=deployment.robot))


def serial_port(device: str) -> Diagnosis:
    """Whether it is there and may be opened."""
    path = Path(device)
    if not path.exists():
        why = because("doctor.serial.absent", remedy("plug_in"), port=device)
        return Diagnosis(Verdict.ERROR, "serial port", why)
    if not os.access(path, os.R_OK | os.W_OK):
        why = because("doctor.serial.denied", remedy("join_dialout"), port=device)
        return Diagnosis(Verdict.ERROR, "serial port", why)
    return Diagnosis(Verdict.OK, "serial port", because("doctor.serial", port=device))


def _listener(name: str, host: str, port: int) -> Diagnosis:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError as error:
        text = str(error.strerror or error)
        why = because("doctor.listens.not", remedy_when_silent(host), host=host, port=port, error=text)
        return Diagnosis(Verdict.ERROR, name, why)
    return Diagnosis(Verdict.OK, name, because("doctor.listens", host=host, port=port))


def broker(section: MqttSection) -> Diagnosis:
    """Of the broker: whether it is there, and lets the gateway in."""
    from gemelo.libraries.mqtt.check import problem  # 50 ms

    try:
        access = gateway_access(section)
    except AccessError as error:
        return _broker_refuses(reason_of(error))
    listening = _listener("broker", section.host, section.port)
    if listening.verdict is Verdict.ERROR and access.is_ours:
        return listening
    said = problem(access)
    return listening if said is None else _broker_refuses(said)


def _broker_refuses(why: Reason) -> Diagnosis:
    return Diagnosis(Verdict.ERROR, "broker", because("doctor.broker", why, remedy("broker_page")))


def _twin() -> Iterator[Diagnosis]:
    try:
        with connect() as session:
            yield from twin(session)
    except CommandError as error:
        yield Diagnosis(Verdict.ERROR, "twin", because("doctor.twin", text=str(error)))


def twin(session: CommandSession) -> Iterator[Diagnosis]:
    """Of the nodes, the device and the clocks."""
    node = session.node
    statuses: list[DeviceStatus] = []
    states: list[DeviceState] = []
    node.subscribe(DEVICE_STATUS, statuses.append)
    node.subscribe(DEVICE_STATE, states.append)
    node.wait(LISTENING)
    nodes, host = living(session), session.deployment.router.host
    if nodes:
        yield Diagnosis(Verdict.OK, "nodes", because("doctor.nodes", names=", ".join(nodes)))
    else:
        yield Diagnosis(Verdict.ERROR, "nodes", because("doctor.nodes.none", remedy_when_silent(host)))
    yield from twins(node.twins())
    yield device(statuses[-1] if statuses else None, states[-1] if states else None, host, node.now())
    yield from warning(statuses[-1] if statuses else None)
    told = _told(session, nodes)
    yield versions({name: info for name, (info, _) in told.items()})
    yield from unwritten(info for info, _ in told.values())
    yield from descriptors(info for info, _ in told.values() if info.host == session.node.info().host)
    yield clocks({name: clock for name, (_, clock) in told.items() if clock is not None})


def twins(borne: Mapping[str, tuple[str, ...]]) -> Iterator[Diagnosis]:
    """Several nodes of one name: the older gives way by itself, unless it stands still."""
    for name, processes in borne.items():
        hint = remedy("older_gives_way", process=processes[0])
        why = because("doctor.two", hint, node=name, count=len(processes), processes=", ".join(processes))
        yield Diagnosis(Verdict.ERROR, f"two {name}", why, because("doctor.title.two", node=name))


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
        why = because("doctor.node_versions", count=len(infos), version=own)
        return Diagnosis(Verdict.OK, "versions of the nodes", why)
    why = because("doctor.node_versions.other", remedy("one_version"), others=", ".join(others), version=own)
    return Diagnosis(Verdict.WARNING, "versions of the nodes", why)


def unwritten(infos: Iterable[NodeInfo]) -> Iterator[Diagnosis]:
    """What a node cannot write to its disk, with the remedies; nothing for one that can."""
    for info in infos:
        if info.unwritten:
            title = because("doctor.title.files", node=info.node, host=info.host)
            why = because("doctor.unwritten", text=info.unwritten)
            yield Diagnosis(Verdict.WARNING, f"files of {info.node} on {info.host}", why, title)


def descriptors(infos: Iterable[NodeInfo]) -> Iterator[Diagnosis]:
    """The processes of this host that soon get no file or connection any more; those of other users are left out."""
    import psutil  # 20 ms

    for info in infos:
        with suppress(psutil.Error):
            process = psutil.Process(info.pid)
            used, most = process.num_fds(), process.rlimit(psutil.RLIMIT_NOFILE)[0]
            if most - used < LEAST_DESCRIPTORS:
                why = because("doctor.descriptors", remedy("raise_descriptors"), used=used, limit=most)
                title = because("doctor.title.descriptors", node=info.node)
                yield Diagnosis(Verdict.WARNING, f"descriptors of {info.node}", why, title)


def device(status: DeviceStatus | None, state: DeviceState | None, host: str, now: int = 0) -> Diagnosis:
    """Whether it is online, and in no fault, at `now` [ns UNIX]; `host`: the router's, where its gateway should be."""
    if status is None:
        return Diagnosis(Verdict.ERROR, "device", because("doctor.device.silent", remedy_when_silent(host)))
    if not status.online:
        return Diagnosis(Verdict.ERROR, "device", _offline(status, now))
    if state is not None and (fault := fault_reason(state.fault)):
        return Diagnosis(Verdict.WARNING, "device", because("doctor.device.fault", fault, remedy("reset_when_seen")))
    if state is None:
        return Diagnosis(Verdict.OK, "device", because("doctor.device", device=status.device))
    trip = state_round_trip(state)
    return Diagnosis(Verdict.OK, "device", because("doctor.device.round_trip", trip, device=status.device))


def _offline(status: DeviceStatus, now: int) -> Reason:
    """Where its states arrive, the reason has the causes and what to do."""
    why = why_not_usable(status, now)
    if not status.speaks:
        return because("doctor.device.offline", why, remedy("power_and_broker"))
    return because("doctor.device.not_usable", why, *((remedy("broker_acl"),) if status.deaf_since else ()))


def warning(status: DeviceStatus | None) -> Iterator[Diagnosis]:
    """What a person has to mend beside an online device: two planners, another program on the device's topics."""
    if status is not None and (why := warning_of(status)) is not None:
        yield Diagnosis(Verdict.WARNING, "who speaks", because("doctor.warning", why))


def clocks(offsets: Mapping[str, ClockOffset]) -> Diagnosis:
    """How far the clock of each node's host is from this one's; no motion depends on it."""
    if not offsets:
        return Diagnosis(Verdict.WARNING, "clocks", because("doctor.clocks.unknown"))
    apart = {name: each for name, each in offsets.items() if abs(each.offset) > MOST_SKEW + each.bound}
    if apart:
        found = ", ".join(f"{name} {each}" for name, each in apart.items())
        why = because("doctor.clocks.apart", remedy("one_time_server"), offsets=found)
        return Diagnosis(Verdict.WARNING, "clocks", why)
    name = max(offsets, key=lambda each: abs(offsets[each].offset))
    why = because("doctor.clocks", count=len(offsets), node=name, offset=str(offsets[name]))
    return Diagnosis(Verdict.OK, "clocks", why)
