"""The processes of each host of a site, with the robot, the role and the certificate of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from gemelo.schemas.roles import ROLE_OF_NODE
from gemelo.schemas.site import Site

ROUTER, BROKER = "router", "broker"
TASKS, FILES = 256, 4096  # that one process may have, beside its memory: what leaks ends itself, and not the host


@dataclass(frozen=True)
class ServiceRow:
    """A row of the table of services."""

    name: str
    about: str
    memory: str  # [systemd's] above which it is ended: three times and more of what it takes on rm1
    extras: tuple[str, ...] = ()  # of pyproject.toml
    is_ahead: bool = False  # it may take a real-time priority: what a stop or a heartbeat goes through


SERVICES = {
    each.name: each
    for each in (
        ServiceRow(ROUTER, "the Zenoh router", "512M", is_ahead=True),
        ServiceRow(BROKER, "the MQTT broker", "256M", is_ahead=True),
        ServiceRow("virtual_esp32", "the firmware core on real MQTT", "256M", is_ahead=True),
        ServiceRow("stepper_gateway", "trajectories to step knots", "512M", is_ahead=True),
        ServiceRow("state_publisher", "joint states to frames", "256M"),
        ServiceRow("planner", "goals to verified trajectories", "4G", ("planner",)),
        ServiceRow("logger", "everything to MCAP, every command to CSV", "1G", ("record",)),
        ServiceRow("visualizer", "everything to Rerun", "2G", ("view",)),
        ServiceRow("viewer", "the Rerun viewer", "6G", ("view",)),
        ServiceRow("panel", "the operator's page", "2G", ("panel",)),
        ServiceRow("camera", "the images of all cameras", "1G", ("eyes",)),
        ServiceRow("detector", "what is in the images", "1G", ("eyes",)),
    )
}
OF_A_ROBOT = tuple(name for name in SERVICES if name not in (ROUTER, BROKER))


@dataclass(frozen=True)
class Process:
    """One process on one host."""

    service: ServiceRow
    robot: str = ""  # empty: of the whole site

    @property
    def unit(self) -> str:
        """Its name among all of the host."""
        return "-".join(filter(None, ("gemelo", self.robot, self.service.name)))

    @property
    def program(self) -> str:
        """Its console script."""
        return f"gemelo-{self.service.name.replace('_', '-')}"

    @property
    def role(self) -> str:
        """The certificate that it shows to the router; empty where it does not join."""
        return ROLE_OF_NODE.get(self.service.name, "")


def processes(site: Site, host: str) -> Iterator[Process]:
    """What runs on a host, router and broker first."""
    if site.router.host == host:
        yield Process(SERVICES[ROUTER])
    if site.broker.host == host:
        yield Process(SERVICES[BROKER])
    for robot, names in site.hosts[host].services.items():
        yield from (Process(SERVICES[name], robot) for name in names)


def extras(site: Site, host: str) -> tuple[str, ...]:
    """The extras of pyproject.toml that a host needs for its services."""
    return tuple(sorted({extra for process in processes(site, host) for extra in process.service.extras}))


def roles(site: Site, host: str) -> tuple[str, ...]:
    """The roles that need a certificate on a host."""
    of_services = {process.role for process in processes(site, host)} - {""}
    return tuple(sorted(of_services | set(site.hosts[host].roles)))


def principal(role: str, host: str) -> str:
    """The common name of a role's certificate on a host: whoever works there has a name of his own on the bus."""
    return role if role in ROLE_OF_NODE.values() else f"{role}.{host}"


def principals(site: Site) -> dict[str, tuple[str, ...]]:
    """The common names of all certificates of the site, by role."""
    named = [(role, principal(role, host)) for host in site.hosts for role in roles(site, host)]
    return {role: tuple(dict.fromkeys(name for each, name in named if each == role)) for role, _ in named}


def robots(site: Site, host: str) -> tuple[str, ...]:
    """The robots that a host needs a deployment file for: its services', and all of them where people work."""
    return tuple(site.robots) if site.hosts[host].roles else tuple(site.hosts[host].services)


def listening(site: Site, host: str) -> str:
    """The address that router and broker listen on there."""
    return site.hosts[host].listen or site.hosts[host].address
