"""The credentials that a board gets over its serial line: networks, broker, passwords. No password is an argument."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec

from gemelo.libraries.credentials.private_files import AccessError, require_private
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import usage
from gemelo.tools.cli.common.language import sentence

WIFI_PASSWORD, MQTT_PASSWORD = "GEMELO_WIFI_PASSWORD", "GEMELO_MQTT_PASSWORD"
MQTT_DEVICE_PASSWORD = "GEMELO_MQTT_DEVICE_PASSWORD"  # wins over the other, which is the gateway's too
LONGEST_SSID = 32  # [bytes] IEEE 802.11
BAUD = (9_600, 3_000_000)  # the firmware's bounds
HIDDEN = ("wifi_password", "mqtt_password", "mqtt_ca", "mqtt_certificate", "mqtt_key", "update_key")
LONGEST_PEM = 2048  # [bytes] that a board keeps of one
WPA = (8, 63)  # [characters] of a passphrase


class CredentialsChange(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The JSON of `provision` in firmware/PROTOCOL.md; None leaves what the device has."""

    device: str | None = None
    wifi_ssid: str | None = None
    wifi_password: str | None = None
    mqtt_uri: str | None = None
    mqtt_user: str | None = None
    mqtt_password: str | None = None
    mqtt_ca: str | None = None  # PEM
    mqtt_certificate: str | None = None  # PEM, of the device itself
    mqtt_key: str | None = None  # PEM, of that certificate
    update_key: str | None = None  # PEM, the public key of updates
    serial_baud: str | None = None  # of its serial line, a decimal number
    factory_reset: bool = False

    def text(self) -> bytes:
        """The JSON as it is sent."""
        return msgspec.json.encode(self)

    def summary(self) -> str:
        """The given fields as a line, without a password."""
        said = [f"{name} {value}" for name in ("device", "wifi_ssid", "mqtt_uri", "mqtt_user", "serial_baud")
                if (value := getattr(self, name)) is not None]  # fmt: skip
        hidden = [name for name in HIDDEN if getattr(self, name) is not None]
        return ", ".join([*said, *(sentence(because("provision.given", name=name)) for name in hidden)])


def require_sound(credentials: CredentialsChange) -> CredentialsChange:
    """Returns `credentials`; raises `CommandError` for values that no board could use."""
    ssid, uri = credentials.wifi_ssid, credentials.mqtt_uri
    if ssid is not None and len(ssid.encode()) > LONGEST_SSID:
        raise usage(because("provision.ssid.long", size=len(ssid.encode()), most=LONGEST_SSID))
    if credentials.wifi_password and not WPA[0] <= len(credentials.wifi_password) <= WPA[1]:
        size = len(credentials.wifi_password)
        raise usage(because("provision.password.length", size=size, least=WPA[0], most=WPA[1]))
    if uri is not None and not uri.startswith(("mqtt://", "mqtts://")):
        raise usage(because("provision.uri", uri=uri))
    if credentials.serial_baud is not None and not BAUD[0] <= int(credentials.serial_baud) <= BAUD[1]:
        raise usage(because("provision.baud", baud=credentials.serial_baud, least=BAUD[0], most=BAUD[1]))
    if (credentials.mqtt_certificate is None) != (credentials.mqtt_key is None):
        raise usage(because("provision.certificate_alone"))
    if credentials == CredentialsChange():
        raise usage(because("provision.nothing"))
    return credentials


def password(what: str, variable: str, environ: Mapping[str, str], *more: str) -> str:
    """The password of `what`, a `word.password`: from the environment, else asked for on a terminal without echo, else
    a line of standard input.

    Of the variables `more` and `variable` the first that is set counts.
    """
    for name in (*more, variable):
        if name in environ:
            return environ[name]
    if sys.stdin.isatty():
        return getpass.getpass(f"{sentence(because('provision.password.ask', what=what))} ")
    line = sys.stdin.readline()
    if not line:
        raise usage(because("provision.password.none", what=what, variable=variable))
    return line.rstrip("\r\n")


def certificate(path: Path | None, option: str = "--mqtt-ca") -> str | None:
    """The text of a PEM file; raises `CommandError` if it cannot be read or holds no certificate."""
    return None if path is None else _pem(path, option, "CERTIFICATE-----", "certificate")


def private_key(path: Path | None) -> str | None:
    """The text of a PEM file that its owner alone can read; raises `CommandError` if it holds no plain private key."""
    if path is None:
        return None
    text = _pem(path, "--mqtt-key", "PRIVATE KEY-----", "private key")
    try:
        require_private(str(path))
    except AccessError as error:
        raise usage(because("provision.pem.shared", error.reason, option="--mqtt-key")) from error
    if "ENCRYPTED" in text:
        raise usage(because("provision.pem.encrypted", option="--mqtt-key", path=str(path)))
    return text


def update_key(path: Path | None) -> str | None:
    """The text of a public key that updates are signed for; raises `CommandError` for another one."""
    return None if path is None else _pem(path, "--update-key", "-----BEGIN PUBLIC KEY-----", "public key", 256)


def _pem(path: Path, option: str, marker: str, what: str, longest: int = LONGEST_PEM) -> str:
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise usage(because("provision.pem.unreadable", option=option, path=str(path), error=str(error))) from error
    if marker not in text:
        raise usage(because("provision.pem.none", option=option, path=str(path), what=what))
    if len(text) > longest:
        raise usage(because("provision.pem.long", option=option, path=str(path), size=len(text), most=longest))
    return text
