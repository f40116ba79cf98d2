"""Credentials and factory reset, as they come over the serial line; nothing of them is logged or said again."""

from __future__ import annotations

import json

import msgspec

from firmware.bindings.device import Device
from firmware.bindings.provision import ProvisionRefused, asks_for_factory_reset
from firmware.platform.host.board import Board


def provision(board: Board, device: Device, text: bytes) -> str:
    """Do what `text` asks for; why the device now starts anew. Raises ProvisionRefused."""
    is_reset = asks_for_factory_reset(text)
    if not device.still:
        raise ProvisionRefused("the device moves: stop it first")
    if is_reset:
        board.factory_reset()
        return "factory_reset"
    said = msgspec.json.decode(text, type=dict[str, str | bool])
    said.pop("factory_reset", None)
    board.provision({key: str(value) for key, value in said.items()})
    return "provisioned"


def provision_answer(refusal: str = "") -> bytes:
    """The JSON of `provision/ack`."""
    return json.dumps({"accepted": not refusal, "reason": refusal}).encode()
