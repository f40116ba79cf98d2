"""The state of a site against its file: services that should run, and those that run besides, by the bus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import msgspec

from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.schemas.device import DeviceStatus
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.roles import SERVICES
from gemelo.schemas.site import Site
from gemelo.schemas.system import NodeInfo
from gemelo.tools.hosts.layout import BROKER, ROUTER, processes

DEVICE, VIEWER, VISUALIZER, GATEWAY = "virtual_esp32", "viewer", "visualizer", "stepper_gateway"


class ServiceState(StrEnum):
    """How one service is."""

    READY = "ready"
    NOT_READY = "not ready"
    SILENT = "silent"  # the site's file has it, and the bus has not
    ELSEWHERE = "elsewhere"  # it runs on another host than the file says
    UNKNOWN = "unknown"  # it is not on the bus itself, and who would know it is silent
    NOT_EXPECTED = "not expected"  # it is on the bus, and the file has it not


class ServiceStatus(msgspec.Struct, frozen=True, kw_only=True):
    """One service of a site, or one that is no part of it."""

    host: str  # of the site's file; empty: of none
    robot: str  # empty: of the whole site
    service: str
    standing: ServiceState
    reason: str = ""
    machine: str = ""  # the name that its host gives itself; empty: not on the bus
    version: str = ""
    pid: int = 0
    clock_offset: float | None = None  # [s] its clock against the asker's; None: not measured
    clock_bound: float = 0.0  # [s] by how much at most that is wrong
    certificate_ends: float | None = None  # [s] UNIX time, of the one that it shows; None: none, or it is not known
    why: Reason | None = None  # `reason` as data


@dataclass(frozen=True)
class SeenNode:
    """A node that is alive; without `info` it does not answer."""

    info: NodeInfo | None = None
    clock: ClockOffset | None = None


@dataclass(frozen=True)
class SeenRobot:
    """What the bus says of one robot."""

    nodes: Mapping[str, SeenNode] = field(default_factory=dict)
    device: DeviceStatus | None = None


def site_status(
    site: Site, seen: Mapping[str, SeenRobot], shown: Mapping[str, float | None] | None = None
) -> tuple[ServiceStatus, ...]:
    """`seen` by the robot's name, through the router: of the site's robots, and of others that live there.

    `shown` says when the certificates of router and broker end, in [s] UNIX time.
    """
    return (*_expected(site, seen, shown or {}), *_not_expected(site, seen))


def is_well(found: tuple[ServiceStatus, ...]) -> bool:
    """True if all that the file has is ready, and nothing else is there."""
    return all(each.standing is ServiceState.READY for each in found)


def _expected(
    site: Site, seen: Mapping[str, SeenRobot], shown: Mapping[str, float | None]
) -> Iterator[ServiceStatus]:  # fmt: skip
    for host in site.hosts:
        for process in processes(site, host):
            robot, service = process.robot, process.service.name
            at = seen.get(robot, SeenRobot())
            if process.role and process.service.name in SERVICES:
                yield _node(site, host, robot, service, at.nodes.get(service))
            else:
                standing, why = _from_others(service, robot, seen)
                yield ServiceStatus(
                    host=host, robot=robot, service=service, standing=standing, reason=str(why or ""), why=why,
                    certificate_ends=shown.get(service),
                )  # fmt: skip


def _node(site: Site, host: str, robot: str, service: str, seen: SeenNode | None) -> ServiceStatus:
    if seen is None or seen.info is None:
        silent = because("site.status.absent" if seen is None else "site.status.unanswered")
        return ServiceStatus(
            host=host, robot=robot, service=service, standing=ServiceState.SILENT, reason=str(silent), why=silent
        )
    info, clock, why = seen.info, seen.clock, None
    standing = ServiceState.READY
    if other := _other_host(site, host, info.host):
        standing, why = ServiceState.ELSEWHERE, because("site.status.elsewhere", other=other, host=host)
    elif not info.ready:
        standing, why = ServiceState.NOT_READY, _problem(info) or because("site.status.unexplained")
    return ServiceStatus(
        host=host, robot=robot, service=service, standing=standing, reason=str(why or ""), why=why, machine=info.host,
        version=info.version, pid=info.pid, clock_offset=None if clock is None else clock.offset,
        clock_bound=0.0 if clock is None else clock.bound, certificate_ends=info.certificate_ends,
    )  # fmt: skip


def _other_host(site: Site, host: str, machine: str) -> str:
    """The host of the file that has the machine's name or address, if that is not `host`; else empty."""
    if machine in (host, site.hosts[host].address):
        return ""
    return next((name for name, each in site.hosts.items() if machine in (name, each.address)), "")


def _from_others(service: str, robot: str, seen: Mapping[str, SeenRobot]) -> tuple[ServiceState, Reason | None]:
    """What is not on the bus, by those that need it."""
    at = seen.get(robot, SeenRobot())
    match service:
        case _ if service == ROUTER:
            return ServiceState.READY, None  # all this came through it
        case _ if service == BROKER:
            devices = [each.device for each in seen.values() if each.device is not None]
            if any(each.online for each in devices):
                return ServiceState.READY, None
            why = next((found for each in devices if (found := _offline(each)) is not None), None)
            return ServiceState.UNKNOWN, why or because("site.status.no_gateway")
        case _ if service == DEVICE:
            if at.device is None:
                return ServiceState.UNKNOWN, because("site.status.says_nothing", service=GATEWAY)
            if at.device.online:
                return ServiceState.READY, None
            return ServiceState.SILENT, _offline(at.device) or because("site.status.offline")
        case _:
            shown = at.nodes.get(VISUALIZER)
            if service != VIEWER or shown is None or shown.info is None:
                return ServiceState.UNKNOWN, because("site.status.says_nothing", service=VISUALIZER)
            return (ServiceState.READY, None) if shown.info.ready else (ServiceState.UNKNOWN, _problem(shown.info))


def _offline(device: DeviceStatus) -> Reason | None:
    return device.why or (plain(device.reason) if device.reason else None)


def _problem(info: NodeInfo) -> Reason | None:
    return info.why or (plain(info.problem) if info.problem else None)


def _not_expected(site: Site, seen: Mapping[str, SeenRobot]) -> Iterator[ServiceStatus]:
    """Services, and robots, that the file does not have; nodes of people and programs are everybody's."""
    wanted = {(process.robot, process.service.name) for host in site.hosts for process in processes(site, host)}
    for robot, at in seen.items():
        no_robot = because("site.status.no_robot", robot=robot)
        why = because("site.status.not_in_file") if robot in site.robots else no_robot
        for name, node in at.nodes.items():
            if name not in SERVICES or (robot, name) in wanted:
                continue
            info, clock = node.info or NodeInfo(), node.clock
            yield ServiceStatus(
                host="", robot=robot, service=name, standing=ServiceState.NOT_EXPECTED, reason=str(why), why=why,
                machine=info.host,
                version=info.version, pid=info.pid, clock_offset=None if clock is None else clock.offset,
                clock_bound=0.0 if clock is None else clock.bound,
            )  # fmt: skip
