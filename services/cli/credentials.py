"""The credentials that a board gets over its serial line: networks, broker, passwords. No password is an argument."""

from __future__ import annotations

import getpass
import sys
from collections.abc import Mapping
from pathlib import Path

import msgspec

from services.cli.errors import usage

WIFI_PASSWORD, MQTT_PASSWORD = "GEMELO_WIFI_PASSWORD", "GEMELO_MQTT_PASSWORD"
MQTT_DEVICE_PASSWORD = "GEMELO_MQTT_DEVICE_PASSWORD"  # wins over the other, which is the gateway's too
LONGEST_SSID = 32  # [bytes] IEEE 802.11
BAUD = (9_600, 3_000_000)  # the firmware's bounds
WPA = (8, 63)  # [characters] of a passphrase


class Credentials(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """The JSON of `provision` in firmware/PROTOCOL.md; None leaves what the device has."""

    device: str | None = None
    wifi_ssid: str | None = None
    wifi_password: str | None = None
    mqtt_uri: str | None = None
    mqtt_user: str | None = None
    mqtt_password: str | None = None
    mqtt_ca: str | None = None  # PEM
    serial_baud: str | None = None  # of its serial line, a decimal number
    factory_reset: bool = False

    def text(self) -> bytes:
        """The JSON as it is sent."""
        return msgspec.json.encode(self)

    def summary(self) -> str:
        """The given fields as a line, without a password."""
        said = [f"{name} {value}" for name in ("device", "wifi_ssid", "mqtt_uri", "mqtt_user", "serial_baud")
                if (value := getattr(self, name)) is not None]  # fmt: skip
        hidden = [name for name in ("wifi_password", "mqtt_password", "mqtt_ca") if getattr(self, name) is not None]
        return ", ".join([*said, *(f"{name} given" for name in hidden)])


def require_sound(credentials: Credentials) -> Credentials:
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
    if credentials == Credentials():
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


def certificate(path: Path | None) -> str | None:
    """The text of a PEM file; raises `CommandError` if it cannot be read or holds no certificate."""
    if path is None:
        return None
    try:
        text = path.read_text(encoding="ascii")
    except (OSError, UnicodeDecodeError) as error:
        raise usage(f"--mqtt-ca: cannot read {path}: {error}") from error
    if "-----BEGIN CERTIFICATE-----" not in text:
        raise usage(f"--mqtt-ca: {path} holds no certificate in PEM")
    return text
