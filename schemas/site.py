"""`deploy/hosts/<site>.toml` as types: which services of which robot run on which host."""

from __future__ import annotations

import msgspec

from gemelo.schemas.deployment import DeviceKind, Wire


class SiteRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of a site's file; an unknown key is an error."""


class SiteRouter(SiteRecord, frozen=True, kw_only=True):
    host: str  # of [hosts]
    port: int = 7447


class SiteBroker(SiteRecord, frozen=True, kw_only=True):
    """A mosquitto with TLS, users and an ACL."""

    host: str  # of [hosts]
    port: int = 8883


class SiteRobot(SiteRecord, frozen=True, kw_only=True):
    folder: str  # urdf/<robot>, below the project
    cell: str = ""  # cell.toml below the project: cameras, things and places around the arm; empty: none
    device: DeviceKind = DeviceKind.VIRTUAL
    wire: Wire = Wire.MQTT
    serial: str = "/dev/ttyUSB0"  # with wire = "serial"
    panel_port: int = 8088  # the operator's page, on loopback of its host
    viewer_port: int = 9876  # Rerun, data, on loopback
    web_port: int = 9090  # Rerun, page, on loopback


class SiteHost(SiteRecord, frozen=True, kw_only=True):
    address: str  # name or IP address by which the others reach it
    listen: str = ""  # address that router and broker listen on there; empty: address
    services: dict[str, tuple[str, ...]] = {}  # by robot
    roles: tuple[str, ...] = ()  # of the people and programs that work there (schemas/roles.py)


class Site(SiteRecord, frozen=True, kw_only=True):
    name: str  # of the file
    router: SiteRouter
    broker: SiteBroker
    robots: dict[str, SiteRobot]
    hosts: dict[str, SiteHost]
    project: str = "/opt/gemelo"  # where gemelo is installed on every host
    config: str = "/etc/gemelo"  # where rendered files and keys stand there
    state: str = "/var/lib/gemelo"  # recordings, logs, readiness
    user: str = "gemelo"  # that the services run as
    certificate_days: int = 365
