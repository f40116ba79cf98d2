"""The connection of the board to its broker."""

from __future__ import annotations

import json
import logging
import os
import queue
import ssl
import time
from urllib.parse import urlsplit

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import OutFrame
from gemelo.firmware.platform.host.flash import NetworkCredentials
from gemelo.firmware.platform.host.link import REPORTS, DeviceLink, Item
from gemelo.libraries.mqtt.access import BrokerAccess

log = logging.getLogger("virtual_esp32")

SILENT_WAIT = 3.0  # [s] that a broker which is started together with us may take
MQTT_PORT, MQTTS_PORT = 1883, 8883


class AddressError(ValueError):
    """The provisioned address of the broker is none."""


class Network:
    """One device's MQTT; `default` is the broker where none was provisioned."""

    def __init__(self, default: BrokerAccess, inbox: queue.SimpleQueue[Item], place: str = "") -> None:
        """`place` is where this device runs, for who has two of one name."""
        self._default, self._place = default, place
        self._inbox = inbox
        self._link: DeviceLink | None = None
        self._offline_status = b""
        self._started = time.monotonic()
        self._was_refused = ""
        self._denied: set[str] = set()  # what was said of the broker's ACL
        self.is_connected = False

    def join(self, device: CoreDevice, name: str, credentials: NetworkCredentials) -> None:
        """Connect for as long as it takes, with this device's last will; whatever was connected vanishes.

        Raises OSError where the process has no descriptor for it.
        """
        self.break_off()
        self._offline_status = offline_status(name, device.boot_id)
        try:
            broker = broker_address(credentials, self._default)
        except AddressError as error:
            log.error("%s", error)
            return
        self._link = DeviceLink(broker, name, self._offline_status, self._inbox)
        self._link.start()

    def break_off(self) -> None:
        """Disconnects without a status; `join` connects again."""
        if self._link is not None:
            self._link.break_off()
        self._link, self.is_connected = None, False

    def leave(self) -> None:
        """Say goodbye and end."""
        if self._link is not None:
            self._link.close(self._offline_status)

    def publish(self, frame: OutFrame) -> None:
        """Publishes a frame; without a broker it is dropped, because state and status are repeated."""
        if self._link is not None and self.is_connected and frame.kind in REPORTS:
            self._link.publish(frame.kind, self._placed(frame.payload) if frame.kind == "status" else frame.payload)

    def _placed(self, status: bytes) -> bytes:
        """The status, whose JSON names the place too; another firmware's may be no JSON."""
        is_object = self._place and status.endswith(b"}")
        return status[:-1] + b', "place": ' + json.dumps(self._place).encode() + b"}" if is_object else status

    def subscribe_anew(self) -> None:
        """The device is connected and receives nothing: the broker may have lost its subscriptions."""
        if self._link is not None and self.is_connected:
            self._link.subscribe()

    def on_connected(self) -> None:
        self.is_connected, self._was_refused = True, ""
        log.info("connected to the broker")

    def on_disconnected(self, reason: str) -> None:
        if self.is_connected:
            log.warning("lost the broker (%s); trying again", reason)
        elif reason != self._was_refused and time.monotonic() - self._started > SILENT_WAIT:
            log.warning("no connection: %s", reason)
            self._was_refused = reason
        self.is_connected = False

    def on_denied(self, reason: str) -> None:
        """Says once what the broker's ACL denies: the gateway then hears nothing of it."""
        if reason not in self._denied:
            self._denied.add(reason)
            log.error("%s", reason)


def offline_status(name: str, boot_id: int) -> bytes:
    """The JSON of the status of an offline device: the last will."""
    return json.dumps({"online": False, "device": name, "boot_id": boot_id}).encode()


def broker_address(credentials: NetworkCredentials, default: BrokerAccess) -> BrokerAccess:
    """The provisioned broker, or `default` where none was; raises AddressError."""
    if not credentials.mqtt_uri:
        return default
    try:
        uri = urlsplit(credentials.mqtt_uri)
        port = uri.port
    except ValueError as error:
        raise AddressError(f"the provisioned broker {credentials.mqtt_uri!r} is no address: {error}") from error
    if uri.scheme not in ("mqtt", "mqtts") or not uri.hostname:
        raise AddressError(f"the provisioned broker {credentials.mqtt_uri!r} is not mqtt://host or mqtts://host")
    is_secure = uri.scheme == "mqtts"
    return BrokerAccess(
        uri.hostname,
        port or (MQTTS_PORT if is_secure else MQTT_PORT),
        credentials.mqtt_user,
        credentials.mqtt_password if credentials.mqtt_user else "",
        _tls(credentials) if is_secure else None,
        authority="the board's mqtt_ca" if credentials.mqtt_ca else "",
        has_certificate=bool(credentials.mqtt_certificate),
    )


def _tls(credentials: NetworkCredentials) -> ssl.SSLContext:
    """Trusts the provisioned authority, else this system's; shows a provisioned certificate. Raises AddressError."""
    try:
        context = ssl.create_default_context(cadata=credentials.mqtt_ca or None)
    except ssl.SSLError as error:
        raise AddressError(f"the provisioned certificate authority cannot be read: {error}") from error
    if credentials.mqtt_certificate:
        _show_ourselves(context, credentials)
    return context


def _show_ourselves(context: ssl.SSLContext, credentials: NetworkCredentials) -> None:
    # ssl reads files only, with the key and its certificate in one if need be; this one is in memory, and no disk's.
    with open(os.memfd_create("certificate"), "wb") as file:
        file.write(f"{credentials.mqtt_key}\n{credentials.mqtt_certificate}\n".encode())
        file.flush()
        try:
            context.load_cert_chain(f"/proc/self/fd/{file.fileno()}", password=lambda: "")
        except ssl.SSLError as error:
            raise AddressError(f"the provisioned mqtt_certificate and mqtt_key cannot be used: {error}") from error
