"""Checks of a site's file before anything is written: every problem with its line."""

from __future__ import annotations

import ipaddress
import re
import tomllib
from collections import defaultdict
from pathlib import Path, PurePosixPath

from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.credentials.authority import DAYS
from gemelo.libraries.runtime.deployment import is_loopback
from gemelo.libraries.toml_lines import Where
from gemelo.schemas.deployment import DeviceKind, Wire
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.roles import ROLES
from gemelo.schemas.site import Site
from gemelo.tools.hosts.certificates import AUTHORITY_FOLDER
from gemelo.tools.hosts.deployments import HOST
from gemelo.tools.hosts.layout import BROKER, OF_A_ROBOT, ROUTER
from gemelo.tools.hosts.site_file import Problems, nearest, read_site

USER = re.compile(r"[a-z_][a-z0-9_-]{0,31}")  # as useradd takes it
ZONE = re.compile(r"[A-Za-z0-9_.-]{1,15}")  # an interface's name after the % of an IPv6 address (RFC 4007)
NUMBERS = re.compile(r"[0-9.]+")  # of an address with a number too many or too large; no host's name ends in one
LABEL = re.compile(r"[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?")  # of a host's name (RFC 1123)
HAS_MEANING = re.compile(r"[$%\\]")  # to systemd, process-compose and compose, whatever stands around it
GATEWAY, DEVICE = "stepper_gateway", "virtual_esp32"
EYES = ("camera", "detector")
NEEDED = (GATEWAY, "state_publisher")  # without them a robot has no state


def load_site(file: Path, project: Path) -> Site:
    """The site of `file`, checked against the robots below `project`; raises `SiteError` with all that is wrong."""
    site, problems = read_site(file)
    for check in (_addresses, _places, _services, _lines, _roles, _listeners, _paths):
        check(site, problems)
    _robots(site, problems, project)
    problems.raise_any()
    return site


def _addresses(site: Site, problems: Problems) -> None:
    seen: dict[str, str] = {}
    for name, host in site.hosts.items():
        if name == AUTHORITY_FOLDER:  # its folder would go to a host with the key in it
            problems.add(("hosts", name), because("site.host.authority", name=name))
        for key, address in (("address", host.address), ("listen", host.listen)):
            if (address or key == "address") and not _is_address(address):
                problems.add(("hosts", name, key), because("site.host.address", address=repr(address)))
        if host.address.lower() in seen:
            other = seen[host.address.lower()]
            problems.add(
                ("hosts", name, "address"), because("site.host.same_address", address=host.address, other=other)
            )
        seen.setdefault(host.address.lower(), name)
        if len(site.hosts) > 1:
            _require_reachable(site, name, problems)
        for key in ("address", "listen") if name in (site.router.host, site.broker.host) else ():
            if "%" in getattr(host, key):
                problems.add(("hosts", name, key), because("site.host.zone", address=getattr(host, key)))
        if _is_unspecified(host.address):
            problems.add(("hosts", name, "address"), because("site.host.unspecified", address=host.address))


def _require_reachable(site: Site, name: str, problems: Problems) -> None:
    """Where there are several hosts, each reaches the others."""
    host, serves = site.hosts[name], name in (site.router.host, site.broker.host)
    if is_loopback(host.address):
        problems.add(("hosts", name, "address"), because("site.host.loopback", address=host.address, name=name))
    elif serves and host.listen and is_loopback(host.listen):
        problems.add(("hosts", name, "listen"), because("site.host.listens_alone", address=host.listen, name=name))


def _places(site: Site, problems: Problems) -> None:
    for key, host in ((ROUTER, site.router.host), (BROKER, site.broker.host)):
        if host not in site.hosts:
            why = because("site.host.unknown", nearest(host, site.hosts), service=key, host=host)
            problems.add((key, "host"), why)


def _services(site: Site, problems: Problems) -> None:
    where: dict[tuple[str, str], str] = {}
    for name, host in site.hosts.items():
        for robot, services in host.services.items():
            place: Where = ("hosts", name, "services", robot)
            if robot not in site.robots:
                problems.add(place, because("site.robot.unknown", nearest(robot, site.robots), robot=robot))
            for index, service in enumerate(services):
                if service not in OF_A_ROBOT:
                    own_table = because("site.service.own_table", service=service)
                    other_one = because("site.service.unknown", nearest(service, OF_A_ROBOT), service=service)
                    problems.add((*place, index), own_table if service in (ROUTER, BROKER) else other_one)
                elif other := where.get((robot, service)):
                    twice = {"robot": robot, "service": service, "first": other, "second": name}
                    problems.add((*place, index), because("site.service.twice", **twice))
                else:
                    where[robot, service] = name
    for robot, settings in site.robots.items():
        _require_complete(robot, settings.device, {each: where.get((robot, each), "") for each in OF_A_ROBOT}, problems)


def _lines(site: Site, problems: Problems) -> None:
    """A serial line ends on the host of the gateway, and a virtual device's is a file there."""
    for robot, settings in site.robots.items():
        if settings.wire is not Wire.SERIAL:
            continue
        if not PurePosixPath(settings.serial).is_absolute():
            problems.add(("robots", robot, "serial"), because("site.serial", path=settings.serial))
        ends = [name for name, host in site.hosts.items() if {GATEWAY, DEVICE} & {*host.services.get(robot, ())}]
        if settings.device is DeviceKind.VIRTUAL and len(ends) > 1:
            problems.add(("robots", robot, "wire"), because("site.serial.virtual", robot=robot))


def _require_complete(robot: str, device: DeviceKind, where: dict[str, str], problems: Problems) -> None:
    """`where` is the host of each service, empty for none."""
    place: Where = ("robots", robot)
    needed = (*NEEDED, *((DEVICE,) if device is DeviceKind.VIRTUAL else ()))
    for missing in (service for service in needed if not where[service]):
        problems.add(place, because("site.service.missing", robot=robot, service=missing))
    if where[DEVICE] and device is DeviceKind.BOARD:
        idle = {"robot": robot, "service": DEVICE, "host": where[DEVICE]}
        problems.add(place, because("site.service.idle", **idle))
    if where["visualizer"] != where["viewer"]:
        problems.add(place, because("site.service.viewer", robot=robot))


def _roles(site: Site, problems: Problems) -> None:
    people = [role.name for role in ROLES if not role.node]
    for name, host in site.hosts.items():
        for index, role in enumerate(host.roles):
            if role not in people:
                why = because("site.role", nearest(role, people), role=role)
                problems.add(("hosts", name, "roles", index), why)


def _listeners(site: Site, problems: Problems) -> None:
    """Two that would listen on one port of a host."""
    ports: defaultdict[str, list[tuple[int, Reason, Where]]] = defaultdict(list)
    ports[site.router.host].append((site.router.port, because("site.port.of", service=ROUTER), (ROUTER, "port")))
    ports[site.broker.host].append((site.broker.port, because("site.port.of", service=BROKER), (BROKER, "port")))
    for name, host in site.hosts.items():
        for robot, services in host.services.items():
            settings = site.robots.get(robot)
            for service, key in (("panel", "panel_port"), ("viewer", "viewer_port"), ("viewer", "web_port")):
                if settings is not None and service in services:
                    place: Where = ("robots", robot, key)
                    who = because("site.port.of_robot", service=service, robot=robot, key=key)
                    ports[name].append((getattr(settings, key), who, place))
    for name, wanted in ports.items():
        taken: dict[int, Reason] = {}
        for port, who, place in wanted:
            if not 1024 <= port < 65536:
                problems.add(place, because("site.port.root" if 0 < port < 1024 else "site.port.none", port=port))
            elif port in taken:
                problems.add(place, because("site.port.taken", taken[port], who, port=port, host=name))
            taken[port] = who


def _paths(site: Site, problems: Problems) -> None:
    for key in ("project", "config", "state"):
        path = getattr(site, key)
        if not PurePosixPath(path).is_absolute() or ".." in PurePosixPath(path).parts or path == "/":
            problems.add((key,), because("site.path.absolute", key=key, path=path))
        _require_meaningless(path, (key,), problems)
    for key in ("project", "config"):
        if PurePosixPath(getattr(site, key)).is_relative_to(site.state):
            problems.add((key,), because("site.path.state", state=site.state, key=key))
    for robot, settings in site.robots.items():
        for key in ("folder", "cell", "serial"):
            _require_meaningless(getattr(settings, key), ("robots", robot, key), problems)
    if not USER.fullmatch(site.user):
        problems.add(("user",), because("site.user", user=site.user))
    if site.user == "root":
        problems.add(("user",), because("site.user.root"))
    if not 1 <= site.certificate_days <= DAYS:
        problems.add(("certificate_days",), because("site.days", days=site.certificate_days, most=DAYS))


def _robots(site: Site, problems: Problems, project: Path) -> None:
    """The robots' own files: their names, and the names of their devices at the broker."""
    devices: dict[str, str] = {}
    for robot, settings in site.robots.items():
        place: Where = ("robots", robot, "folder")
        if robot == HOST:
            problems.add(("robots", robot), because("site.robot.host", name=HOST))
        if not _is_below(settings.folder):
            problems.add(place, because("site.robot.folder", folder=settings.folder, robot=robot))
            continue
        try:
            arm = load_arm(project / settings.folder)
        except (ConfigurationError, OSError, tomllib.TOMLDecodeError) as error:
            problems.add(place, because("site.robot", _why(error), robot=robot))
            continue
        if arm.name != robot:
            problems.add(place, because("site.robot.name", folder=settings.folder, name=arm.name))
        if arm.device.name in devices and settings.wire is Wire.MQTT:
            other = devices[arm.device.name]
            both = {"first": robot, "second": other, "device": arm.device.name}
            problems.add(place, because("site.robot.device", **both))
        devices[arm.device.name] = robot
        _cell(site, robot, arm, problems, project)


def _cell(site: Site, robot: str, arm: ArmDescription, problems: Problems, project: Path) -> None:
    """What is around the arm; cameras and detector have nothing to do without it."""
    cell, place = site.robots[robot].cell, ("robots", robot, "cell")
    eyes = [(name, each) for name, host in site.hosts.items() for each in EYES if each in host.services.get(robot, ())]
    for name, each in eyes if not cell else ():
        place_of_service: Where = ("hosts", name, "services", robot)
        problems.add(place_of_service, because("site.cell.needed", service=each, robot=robot))
    if not cell:
        return
    if not _is_below(cell):
        return problems.add(place, because("site.cell.folder", cell=cell, robot=robot))
    try:
        load_cell(project / cell, arm)
    except (ConfigurationError, OSError, tomllib.TOMLDecodeError) as error:
        problems.add(place, because("site.robot", _why(error), robot=robot))


def _why(error: Exception) -> Reason:
    return error.reason if isinstance(error, ConfigurationError) else plain(str(error))


def _is_below(path: str) -> bool:
    """True for a path that stays below the project."""
    return not PurePosixPath(path).is_absolute() and ".." not in PurePosixPath(path).parts


def _require_meaningless(path: str, place: Where, problems: Problems) -> None:
    if HAS_MEANING.search(path) or path != path.strip():
        problems.add(place, because("site.path.meaning", path=path))


def _is_address(text: str) -> bool:
    try:
        address = ipaddress.ip_address(text)
    except ValueError:
        return (
            len(text) < 254 and not NUMBERS.fullmatch(text) and all(LABEL.fullmatch(each) for each in text.split("."))
        )
    zone = getattr(address, "scope_id", None)  # of which Python takes any text
    return zone is None or ZONE.fullmatch(zone) is not None


def _is_unspecified(text: str) -> bool:
    try:
        return ipaddress.ip_address(text).is_unspecified
    except ValueError:
        return False
