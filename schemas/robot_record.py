"""The base of the tables of robot.toml, and the bounded numbers and names in them."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

KeyPart = Annotated[str, Meta(pattern="^[A-Za-z0-9_-]+$")]  # part of a key on the bus or of an MQTT topic
Pin = Annotated[int, Meta(ge=0, le=63)]  # GPIO
NotNegative = Annotated[float, Meta(ge=0.0)]
Positive = Annotated[float, Meta(gt=0.0)]
Edges = tuple[Positive, Positive, Positive]  # (3,) [m] of a box
PulseWidth = Annotated[int, Meta(ge=500, le=2500)]  # [us] of a servo


class RobotRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A table of robot.toml; an unknown key is an error."""
