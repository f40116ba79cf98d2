"""A virtual arm whose device says that it knows no replacement: streamed targets take the way of such a device."""

from __future__ import annotations

import json

from gemelo.tools.virtual_arm.gateway_driver import Kind
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm


class OlderArm(VirtualArm):
    """Its firmware is today's, but its status has version 1 of the protocol."""

    def receive(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        if kind is Kind.STATUS and payload:
            payload = json.dumps({**json.loads(payload), "protocol": [1, 1]}).encode()
        super().receive(kind, payload, retained)
