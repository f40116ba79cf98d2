"""The links of a virtual board: MQTT, and a serial line if it has one."""

from __future__ import annotations

import json
import logging
from typing import Protocol

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import OutFrame
from gemelo.firmware.platform.host.flash import NetworkCredentials
from gemelo.firmware.platform.host.pty import SerialLine
from gemelo.libraries.runtime.serial_frames import JsonFrame

log = logging.getLogger("virtual_esp32")

SHAFT_PERIOD = 0.1  # [s]
LOGGED_WITH_TIME = ("fault", "estop", "hold", "underrun")
LOGGED = ("homed", "configured", "injected", "inject_refused")


class BoardNetwork(Protocol):
    """The board's way to its broker: `Network`, or that of a simulation."""

    is_connected: bool

    def join(self, device: CoreDevice, name: str, credentials: NetworkCredentials) -> None: ...

    def break_off(self) -> None: ...

    def leave(self) -> None: ...

    def publish(self, frame: OutFrame) -> None: ...

    def on_connected(self) -> None: ...

    def on_disconnected(self, reason: str) -> None: ...

    def on_denied(self, reason: str) -> None: ...

    def subscribe_anew(self) -> None: ...


class Wires:
    """The network and the line of one board; the device itself knows what goes where."""

    def __init__(self, network: BoardNetwork, line: SerialLine | None) -> None:
        self.network = network
        self._line = line
        self._next_shaft = 0.0

    @property
    def is_reachable(self) -> bool:
        """Somebody can speak to the board."""
        return self.network.is_connected or self._line is not None

    def attach(self, device: CoreDevice) -> None:
        """A device that has just started speaks over the line from now on."""
        if self._line is not None:
            device.attach_line()

    def listen(self) -> None:
        """Hear the line; the network is joined by itself."""
        if self._line is not None:
            self._line.start()

    def beat(self) -> None:
        """To be called now and then: what could not be made is tried again."""
        if self._line is not None:
            self._line.beat()

    def close(self) -> None:
        """Say goodbye and end."""
        self.network.leave()
        if self._line is not None:
            self._line.close()

    def publish(self, device: CoreDevice, now: float) -> bool:
        """Sends the device's frames, and its shaft positions ten times a second; `now` in [s] monotonic.

        True if `status` was among them and has reached somebody: the broker, or whoever speaks on the line.
        """
        has_told = False
        if now >= self._next_shaft:
            self._next_shaft = now + SHAFT_PERIOD
            report = device.shaft_report()
            if device.say(JsonFrame.SHAFT, report):
                self.network.publish(OutFrame("shaft", report))
        for frame in device.take():
            if frame.kind == "event":
                _log_event(frame)
            has_told = has_told or (frame.kind == "status" and self.network.is_connected)
            self.network.publish(frame)
        if self._line is not None:
            self._line.write(device.take_serial())
        return has_told or device.told_status


def say_event(device: CoreDevice, name: str, detail: str) -> None:
    """As the firmware says its own; this one is the world's."""
    event = {"event": name, "t_us": device.now_us, "boot_id": device.boot_id, "stream": 0, "detail": detail}
    device.say(JsonFrame.EVENT, json.dumps(event).encode())


def _log_event(frame: OutFrame) -> None:
    event = json.loads(frame.payload)
    if event["event"] in LOGGED_WITH_TIME:
        level = logging.INFO if event["detail"] == "command" else logging.WARNING
        log.log(level, "%s %s at %.3f s", event["event"], event["detail"], event["t_us"] / 1e6)
    elif event["event"] in LOGGED:
        log.info("%s %s", event["event"], event["detail"])
