"""The access to a broker, read from the deployment: address, user, password and TLS.

A password is in the environment or in a file that its owner alone can read; it is never shown.
"""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gemelo.libraries.credentials.private_files import AccessError, require_private
from gemelo.schemas.deployment import Broker, MqttSection
from gemelo.schemas.reasons import because

PASSWORD, DEVICE_PASSWORD = "GEMELO_MQTT_PASSWORD", "GEMELO_MQTT_DEVICE_PASSWORD"  # in the environment
GATEWAY = "gateway"  # its user name, where `gemelo broker secure` names it
AUTHORITY = "ca.pem"  # of a secure folder


@dataclass(frozen=True)
class BrokerAccess:
    """The address, credentials and TLS context of a broker."""

    host: str
    port: int
    user: str = ""
    password: str = field(default="", repr=False)
    tls: ssl.SSLContext | None = field(default=None, repr=False)
    authority: str = ""  # the file that `tls` trusts; empty: those of this system
    has_certificate: bool = False  # of our own
    is_ours: bool = False  # the process `broker`

    @property
    def place(self) -> str:
        """Host and port."""
        return f"{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"the MQTT broker at {self.place}"


def gateway_access(section: MqttSection, environ: Mapping[str, str] | None = None) -> BrokerAccess:
    """The gateway's access; raises `AccessError`."""
    _require_consistent(section)
    folder = section.secure_folder
    user = section.user or (GATEWAY if folder else "")
    file = section.password_file or (str(Path(folder) / f"{user}.password") if folder else "")
    return _access(section, user, _password(user, file, PASSWORD, environ))


def device_access(section: MqttSection, device: str, environ: Mapping[str, str] | None = None) -> BrokerAccess:
    """The access of a virtual device that was not provisioned with any; raises `AccessError`."""
    if not section.device_user and not section.secure_folder:
        return gateway_access(section, environ)
    _require_consistent(section)
    user, folder = section.device_user or device, section.secure_folder
    file = section.device_password_file or (str(Path(folder) / f"{user}.password") if folder else "")
    return _access(section, user, _password(user, file, DEVICE_PASSWORD, environ))


def read_secret(path: str) -> str:
    """The first line of a file that its owner alone can read; raises `AccessError` with the remedy."""
    require_private(path)
    try:
        with open(path, encoding="utf-8") as file:
            secret = file.readline().rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        raise AccessError(because("broker.password.unreadable", file=path, error=str(error))) from None
    if not secret:
        raise AccessError(because("broker.password.none", file=path))
    return secret


def _require_consistent(section: MqttSection) -> None:
    if section.broker is not Broker.EXTERNAL and (section.tls or section.user) and not section.secure_folder:
        raise AccessError(because("broker.section.own"))
    if not section.tls and not section.secure_folder and (section.ca or section.certificate or section.key):
        raise AccessError(because("broker.section.no_tls"))
    if section.key and not section.certificate:
        raise AccessError(because("broker.section.key"))


def _password(user: str, file: str, variable: str, environ: Mapping[str, str] | None) -> str:
    """`variable` wins over `file`, as every variable does."""
    environ = os.environ if environ is None else environ
    if not user:
        return ""
    if environ.get(variable):
        return environ[variable]
    return read_secret(file) if file else ""


def _access(section: MqttSection, user: str, password: str) -> BrokerAccess:
    folder = section.secure_folder
    authority = section.ca or (str(Path(folder) / AUTHORITY) if folder else "")
    is_tls = section.tls or bool(folder)
    return BrokerAccess(
        host=section.host,
        port=section.port,
        user=user,
        password=password,
        tls=tls_context(authority, section.certificate, section.key) if is_tls else None,
        authority=authority,
        has_certificate=bool(section.certificate),
        is_ours=section.broker is not Broker.EXTERNAL,
    )


def tls_context(authority: str = "", certificate: str = "", key: str = "") -> ssl.SSLContext:
    """TLS that trusts the PEM file `authority`, else this system's; with our own certificate if there is one."""
    try:
        context = ssl.create_default_context(cafile=authority or None)
    except ssl.SSLError:
        raise AccessError(because("broker.ca.none", file=authority)) from None
    except OSError as error:
        raise AccessError(because("broker.ca.unreadable", file=authority, error=error.strerror or str(error))) from None
    if certificate:
        _show_ourselves(context, certificate, key)
    return context


def _show_ourselves(context: ssl.SSLContext, certificate: str, key: str) -> None:
    require_private(key or certificate)

    def refuse() -> str:  # instead of asking on the terminal of a service
        raise AccessError(because("broker.key.encrypted", file=key or certificate))

    try:
        context.load_cert_chain(certificate, key or None, password=refuse)
    except (ssl.SSLError, OSError) as error:
        raise AccessError(because("broker.certificate.unusable", file=certificate, error=str(error))) from None
