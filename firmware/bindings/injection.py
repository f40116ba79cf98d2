"""The inputs and failures that are injected into a virtual device, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.schemas.device import InjectKind, InjectRequest
from gemelo.schemas.device_config import InputRole

LONGEST_FREEZE = 60.0  # [s]
WIDEST_OBJECT = 1.0  # [m]
FURTHEST_SLIP = 1_000_000  # [steps]


class InjectRefused(ValueError):
    """It cannot be done; the message says why, and what could be."""


def read_injection(text: bytes) -> InjectRequest:
    """The JSON of `inject`; raises InjectRefused."""
    try:
        return msgspec.json.decode(text, type=InjectRequest)
    except msgspec.DecodeError as error:
        raise InjectRefused(f"this is no injection: {error}") from error


def inject(device: CoreDevice, request: InjectRequest) -> None:
    """Do it to the device; raises InjectRefused."""
    if not math.isfinite(request.value):
        raise InjectRefused(f"{request.kind}: the value {request.value} is not finite")
    match request.kind:
        case InjectKind.ESTOP:
            _press_estop(device, _choice(request, {0: False, 1: True}))
        case InjectKind.SWITCH:
            state = _choice(request, {-1: None, 0: False, 1: True})
            device.press_input(_index("input", request.target, (i.name for i in device.config.inputs)), state)
        case InjectKind.BLOCK:
            device.block(_joint(device, request), bool(_choice(request, {0: False, 1: True})))
        case InjectKind.SLIP:
            device.slip(_joint(device, request), round(within(request, FURTHEST_SLIP, -FURTHEST_SLIP)))
        case InjectKind.SENSOR:
            names = (sensor.name for sensor in device.config.sensors)
            device.set_sensor(_index("sensor", request.target, names), request.value)
        case InjectKind.OBJECT:
            _put_object(device, within(request, WIDEST_OBJECT))
        case InjectKind.FREEZE:
            device.freeze(within(request, LONGEST_FREEZE))
        case _:
            raise InjectRefused(f"{request.kind}: only the virtual ESP32's process can do that, a device alone cannot")


def _press_estop(device: CoreDevice, pressed: bool | None) -> None:
    buttons = [i for i, wired in enumerate(device.config.inputs) if wired.role is InputRole.ESTOP]
    if not buttons:
        raise InjectRefused('estop: this device has no e-stop; robot.toml wants an [[input]] with role = "estop"')
    for button in buttons:
        # Released is what the contact does by itself.
        device.press_input(button, True if pressed else None)


def _put_object(device: CoreDevice, width: float) -> None:
    if not device.has_jaws:
        raise InjectRefused('object: this device has no servo gripper; robot.toml wants a [gripper] of kind = "servo"')
    if not device.put_object(width):
        apart = (device.opening or 0.0) * 1000.0
        raise InjectRefused(f"object: {width * 1000:g} mm do not fit between the jaws, {apart:.1f} mm apart: open them")


def _joint(device: CoreDevice, request: InjectRequest) -> int:
    return _index("joint", request.target, (joint.name for joint in device.config.joints))


def _index(kind: str, name: str, names: Iterable[str]) -> int:
    known = list(names)
    if name not in known:
        raise InjectRefused(f"there is no {kind} {name!r}; there is {', '.join(known) or 'none'}")
    return known.index(name)


def _choice(request: InjectRequest, choices: dict[int, bool | None]) -> bool | None:
    if request.value not in choices:
        values = ", ".join(str(choice) for choice in choices)
        raise InjectRefused(f"{request.kind}: the value {request.value:g} is none of {values}")
    return choices[int(request.value)]


def within(request: InjectRequest, most: float, least: float = 0.0) -> float:
    """The value, in the unit of its kind, if it is from `least` to `most`; raises InjectRefused."""
    if not least <= request.value <= most:
        raise InjectRefused(f"{request.kind}: the value {request.value:g} is not {least:g} to {most:g}")
    return request.value
