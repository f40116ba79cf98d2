"""The state of a site against its file: services that should run, and those that run besides, by the bus."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import msgspec

from gemelo.libraries.runtime.clock_offset import ClockOffset
from gemelo.schemas.device import DeviceStatus
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
                standing, reason = _from_others(service, robot, seen)
                yield ServiceStatus(
                    host=host, robot=robot, service=service, standing=standing, reason=reason,
                    certificate_ends=shown.get(service),
                )  # fmt: skip


def _node(site: Site, host: str, robot: str, service: str, seen: SeenNode | None) -> ServiceStatus:
    if seen is None:
        return ServiceStatus(
            host=host, robot=robot, service=service, standing=ServiceState.SILENT, reason="it is not on the bus"
        )
    if seen.info is None:
        reason = "it is on the bus, and does not answer"
        return ServiceStatus(host=host, robot=robot, service=service, standing=ServiceState.SILENT, reason=reason)
    info, clock = seen.info, seen.clock
    standing, reason = ServiceState.READY, ""
    if other := _other_host(site, host, info.host):
        standing, reason = ServiceState.ELSEWHERE, f"it runs on {other}; the file has it on {host}"
    elif not info.ready:
        standing, reason = ServiceState.NOT_READY, info.problem or "it does not say why"
    return ServiceStatus(
        host=host, robot=robot, service=service, standing=standing, reason=reason, machine=info.host,
        version=info.version, pid=info.pid, clock_offset=None if clock is None else clock.offset,
        clock_bound=0.0 if clock is None else clock.bound, certificate_ends=info.certificate_ends,
    )  # fmt: skip


def _other_host(site: Site, host: str, machine: str) -> str:
    """The host of the file that has the machine's name or address, if that is not `host`; else empty."""
    if machine in (host, site.hosts[host].address):
        return ""
    return next((name for name, each in site.hosts.items() if machine in (name, each.address)), "")


def _from_others(service: str, robot: str, seen: Mapping[str, SeenRobot]) -> tuple[ServiceState, str]:
    """What is not on the bus, by those that need it."""
    at = seen.get(robot, SeenRobot())
    match service:
        case _ if service == ROUTER:
            return ServiceState.READY, ""  # all this came through it
        case _ if service == BROKER:
            devices = [each.device for each in seen.values() if each.device is not None]
            if any(each.online for each in devices):
                return ServiceState.READY, ""
            why = next((each.reason for each in devices if each.reason), "no gateway says anything of its device")
            return ServiceState.UNKNOWN, why
        case _ if service == DEVICE:
            if at.device is None:
                return ServiceState.UNKNOWN, f"{GATEWAY} says nothing of it"
            return (
                (ServiceState.READY, "")
                if at.device.online
                else (ServiceState.SILENT, at.device.reason or "it is offline")
            )
        case _:
            shown = at.nodes.get(VISUALIZER)
            if service != VIEWER or shown is None or shown.info is None:
                return ServiceState.UNKNOWN, f"{VISUALIZER} says nothing of it"
            return (ServiceState.READY, "") if shown.info.ready else (ServiceState.UNKNOWN, shown.info.problem)


def _not_expected(site: Site, seen: Mapping[str, SeenRobot]) -> Iterator[ServiceStatus]:
    """Services, and robots, that the file does not have; nodes of people and programs are everybody's."""
    wanted = {(process.robot, process.service.name) for host in site.hosts for process in processes(site, host)}
    for robot, at in seen.items():
        reason = "the file does not have it" if robot in site.robots else f"the file has no robot {robot}"
        for name, node in at.nodes.items():
            if name not in SERVICES or (robot, name) in wanted:
                continue
            info, clock = node.info or NodeInfo(), node.clock
            yield ServiceStatus(
                host="", robot=robot, service=name, standing=ServiceState.NOT_EXPECTED, reason=reason,
                machine=info.host,
                version=info.version, pid=info.pid, clock_offset=None if clock is None else clock.offset,
                clock_bound=0.0 if clock is None else clock.bound,
            )  # fmt: skip
