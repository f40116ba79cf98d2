"""The certificates and passwords of a site: one small authority, a certificate for each host and role, and renewal.

The authority's key stays in its own folder below out/; every host's folder holds what that host shows, and no more.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.credentials.expiry import WARN_WITHIN, days_left, expiry
from gemelo.libraries.credentials.private_files import write
from gemelo.libraries.mqtt import secure_folder
from gemelo.libraries.mqtt.access import AUTHORITY, GATEWAY
from gemelo.schemas.site import Site
from gemelo.tools.hosts.certificates import AUTHORITY_FOLDER, Certificate
from gemelo.tools.hosts.layout import listening, principal, processes, roles

LOOPBACK = ("localhost", "127.0.0.1")
UNSPECIFIED = ("0.0.0.0", "::")


def make_keys(site: Site, folder: Path, project: Path, renew_within: float = WARN_WITHIN) -> tuple[Certificate, ...]:
    """Writes what is missing, wrong or ends within `renew_within` [days] below `folder`; raises `AccessError`."""
    authority = authority_in(folder)
    made = [
        certificate for host in site.hosts
        for certificate in _of_host(site, host, authority, _private(folder / host / "keys"), renew_within)
    ]  # fmt: skip
    for host in site.hosts:
        (folder / host / "keys" / "ca.pem").write_text(authority.trusted)
    return (*made, _broker(site, folder, project, authority, renew_within))


def authority_in(folder: Path) -> Authority:
    """The authority of the site whose keys are below `folder`; made if it is not there. Raises `AccessError`."""
    own = _private(_private(folder) / AUTHORITY_FOLDER)
    return Authority(own / "ca.pem", own / "ca.key")


def _of_host(
    site: Site, host: str, authority: Authority, folder: Path, renew_within: float
) -> Iterator[Certificate]:  # fmt: skip
    days = site.certificate_days
    names = tuple(addresses(site, host)) if site.router.host == host else ()
    wanted: dict[str, Callable[[Path, Path], None]] = {
        role: partial(authority.sign_client, principal(role, host), days=days, unit=host) for role in roles(site, host)
    }
    if names:
        wanted["router"] = partial(authority.sign, names, days=days)
    for name, sign in wanted.items():
        certificate, key = folder / f"{name}.pem", folder / f"{name}.key"
        shown = "" if name == "router" else principal(name, host)
        is_new = _is_due(authority, certificate, key, names if name == "router" else (), renew_within, shown)
        if is_new:
            sign(certificate, key)
        yield Certificate(host, name, expiry(certificate), is_new)
    for stray in {each.stem for each in folder.glob("*.pem")} - wanted.keys() - {"ca"}:
        for end in (".pem", ".key"):
            (folder / f"{stray}{end}").unlink(missing_ok=True)


def _is_due(
    authority: Authority, certificate: Path, key: Path, names: tuple[str, ...], renew_within: float, shown: str = ""
) -> bool:
    """True if it is missing, wrong, for another common name than `shown`, or ends within `renew_within` [days]."""
    return not authority.has_signed(certificate, key, names, shown) or days_left(expiry(certificate)) < renew_within


def _broker(site: Site, folder: Path, project: Path, authority: Authority, renew_within: float) -> Certificate:
    """The broker's lock on its host, and on the others the password of each end that runs there."""
    home = folder / site.broker.host / "broker"
    devices = {robot: load_arm(project / settings.folder).device.name for robot, settings in site.robots.items()}
    names = tuple(addresses(site, site.broker.host))
    certificate, key = home / secure_folder.CERTIFICATE, home / secure_folder.KEY
    is_new = _is_due(authority, certificate, key, names, renew_within)
    _forget(home, {GATEWAY, *devices.values()})  # a robot that has left must not come in with the password that it had
    secure_folder.make(home, names, devices.values(), authority, site.certificate_days, is_new)
    (home / AUTHORITY).write_text(authority.trusted)
    for host in site.hosts.keys() - {site.broker.host}:
        on_wire = [(process.service.name, devices.get(process.robot, "")) for process in processes(site, host)]
        users = {GATEWAY for service, _ in on_wire if service == "stepper_gateway"}
        users |= {device for service, device in on_wire if service == "virtual_esp32"}
        _forget(folder / host / "broker", users)
        for user in users:
            _give(home, _private(folder / host / "broker"), user)
    return Certificate(site.broker.host, "broker", expiry(certificate), is_new)


def _forget(folder: Path, users: set[str]) -> None:
    """Takes the passwords of all but `users` from a folder."""
    for file in folder.glob("*.password"):
        if file.stem not in users:
            file.unlink()


def _give(home: Path, folder: Path, user: str) -> None:
    """Copies the password of one user, and what the broker is known by."""
    shutil.copyfile(home / AUTHORITY, folder / AUTHORITY)
    write(folder / f"{user}.password", secure_folder.password_of(home, user) + "\n")


def addresses(site: Site, host: str) -> Iterator[str]:
    """What router or broker of a host may be called by who connects."""
    yield site.hosts[host].address
    if listening(site, host) not in (site.hosts[host].address, *UNSPECIFIED):
        yield listening(site, host)
    yield from LOOPBACK


def _private(folder: Path) -> Path:
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    return folder
