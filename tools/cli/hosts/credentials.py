"""The credentials that a board gets over its serial line: networks, broker, passwords. No password is an argument."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec

from gemelo.libraries.credentials.private_files import AccessError, require_private
from gemelo.tools.cli.common.errors import usage

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
        return ", ".join([*said, *(f"{name} given" for name in hidden)])


def require_sound(credentials: CredentialsChange) -> CredentialsChange:
    """Returns `credentials`; raises `CommandError` for values that no board could use."""
    ssid, uri = credentials.wifi_ssid, credentials.mqtt_uri
    if ssid is not None and len(ssid.encode()) > LONGEST_SSID:
        raise usage(f"--wifi-ssid has {len(ssid.encode())} bytes: a network's name has at most {LONGEST_SSID}")
    if credentials.wifi_password and not WPA[0] <= len(credentials.wifi_password) <= WPA[1]:
        raise usage(f"the Wi-Fi password has {len(credentials.wifi_password)} characters, not {WPA[0]} to {WPA[1]}")
    if uri is not None and not uri.startswith(("mqtt://", "mqtts://")):
        raise usage(f'--mqtt-uri "{uri}" is written as mqtt://host:1883, or mqtts://host:8883 with TLS')
    if credentials.serial_baud is not None and not BAUD[0] <= int(credentials.serial_baud) <= BAUD[1]:
        raise usage(f"--serial-baud {credentials.serial_baud} is not within {BAUD[0]} to {BAUD[1]}")
    if (credentials.mqtt_certificate is None) != (credentials.mqtt_key is None):
        raise usage("--mqtt-cert and --mqtt-key belong together: a certificate is worth nothing without its key")
    if credentials == CredentialsChange():
        raise usage("nothing to tell the device: give --device, --wifi-ssid, --mqtt-uri, ... or --factory-reset")
    return credentials


def password(what: str, variable: str, environ: Mapping[str, str], *more: str) -> str:
    """The password from the environment, else asked for on a terminal without echo, else a line of standard input.

    Of the variables `more` and `variable` the first that is set counts.
    """
    for name in (*more, variable):
        if name in environ:
            return environ[name]
    if sys.stdin.isatty():
        return getpass.getpass(f"{what} (empty: none): ")
    line = sys.stdin.readline()
    if not line:
        raise usage(f"no {what}: set ${variable}, or write it to standard input as a line")
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
        raise usage(f"--mqtt-key: {error}") from error
    if "ENCRYPTED" in text:
        raise usage(f"--mqtt-key: {path} is encrypted, and a board has nobody to ask: take its password away")
    return text


def update_key(path: Path | None) -> str | None:
    """The text of a public key that updates are signed for; raises `CommandError` for another one."""
    return None if path is None else _pem(path, "--update-key", "-----BEGIN PUBLIC KEY-----", "public key", 256)


def _pem(path: Path, option: str, marker: str, what: str, longest: int = LONGEST_PEM) -> str:
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise usage(f"{option}: cannot read {path}: {error}") from error
    if marker not in text:
        raise usage(f"{option}: {path} holds no {what} in PEM")
    if len(text) > longest:
        raise usage(f"{option}: {path} has {len(text)} bytes, a board keeps {longest}: take one with a P-256 key")
    return text
