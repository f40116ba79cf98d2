"""The deployment files of a host: one for each robot, and one for router and broker."""

from __future__ import annotations

from gemelo.schemas.deployment import Broker, ViewerMode
from gemelo.schemas.site import Site
from gemelo.tools.hosts.layout import Process, listening, processes
from gemelo.tools.hosts.quoting import Value, toml

WRITTEN = "# Written by `gemelo deploy render "
HEADER = WRITTEN + "{site} {host}`; what it is made of is deploy/hosts/{site}.toml.\n\n"
HOST = "host"  # the file of router and broker; no robot may have this name


def deployment_of_robot(site: Site, host: str, robot: str) -> str:
    """What every service of the robot on this host reads, and `gemelo` of who works there."""
    settings, at = site.robots[robot], site.hosts
    certificate = certificate_settings(site, at[host].roles[0]) if at[host].roles else {}
    names = {process.service.name for process in processes(site, host) if process.robot == robot}
    tables: dict[str, dict[str, Value]] = {
        "": {
            "robot": settings.folder,
            **({"cell": settings.cell} if settings.cell else {}),
            "device": settings.device,
            "wire": settings.wire,
        },
        "router": {
            "host": at[site.router.host].address,
            "port": site.router.port,
            "tls": True,
            "ca": f"{keys(site)}/ca.pem",
            **certificate,
        },
        "mqtt": {
            "broker": Broker.EXTERNAL,
            "host": at[site.broker.host].address,
            "port": site.broker.port,
            "secure_folder": broker_folder(site),
        },
        "serial": {"device": settings.serial},
        "viewer": {
            "mode": ViewerMode.WEB if "viewer" in names else ViewerMode.NONE,
            "port": settings.viewer_port,
            "web_port": settings.web_port,
        },
        "panel": {"port": settings.panel_port},
        "paths": _paths(site, robot),
    }
    return HEADER.format(site=site.name, host=host) + toml(tables)


def deployment_of_host(site: Site, host: str) -> str:
    """What router and broker of this host read."""
    tables: dict[str, dict[str, Value]] = {
        "router": {
            "host": listening(site, host),
            "port": site.router.port,
            "configuration": f"{site.config}/router.json5",
        },
        "mqtt": {
            "broker": Broker.MOSQUITTO,
            "host": listening(site, host),
            "port": site.broker.port,
            "secure_folder": broker_folder(site),
        },
        "paths": _paths(site, HOST),
    }
    return HEADER.format(site=site.name, host=host) + toml(tables)


def environment(site: Site, process: Process) -> dict[str, str]:
    """What a process gets to know: its deployment file and its certificate."""
    known = {"GEMELO_CONFIG": f"{site.config}/{process.robot or HOST}.toml"}
    if process.role:
        certificate = certificate_settings(site, process.role)
        known |= {f"GEMELO_ROUTER_{key.upper()}": str(value) for key, value in certificate.items()}
    return known


def certificate_settings(site: Site, role: str) -> dict[str, Value]:
    """The files by which a role shows who it is."""
    return {"certificate": f"{keys(site)}/{role}.pem", "key": f"{keys(site)}/{role}.key"}


def keys(site: Site) -> str:
    """The folder of certificates on every host."""
    return f"{site.config}/keys"


def broker_folder(site: Site) -> str:
    """The folder of what belongs to the broker on every host: all of its lock, or one end's password."""
    return f"{site.config}/broker"


def _paths(site: Site, name: str) -> dict[str, Value]:
    return {each: f"{site.state}/{name}/{each}" for each in ("run", "out", "programs")}
