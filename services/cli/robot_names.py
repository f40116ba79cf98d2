"""The names that robot.toml gives to joints and parts of the device, looked up as a person writes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from services.cli.errors import unknown, usage

if TYPE_CHECKING:
    from schemas.robot import Input, Output, Sensor
    from services.arm.model.description import Arm, Joint


def joint_of(arm: Arm, name: str) -> Joint:
    """The joint of that name, or of that name on the wire; raises `CommandError` with the nearest name."""
    for joint in arm.joints:
        if name in (joint.name, joint.wire_name):
            return joint
    raise unknown("joint", name, arm.joint_names)


def joint_name(arm: Arm, name: str) -> str:
    """The joint's name for its name on the wire; any other text is returned as it is."""
    return next((joint.name for joint in arm.joints if name in (joint.name, joint.wire_name)), name)


def require_name(kind: str, name: str, parts: Sequence[Input] | Sequence[Output] | Sequence[Sensor]) -> str:
    """Returns `name` if robot.toml has such a part; raises `CommandError` with the nearest name."""
    known = [part.name for part in parts]
    if not known:
        raise usage(f"robot.toml has no [[{kind}]], so there is none to name")
    if name not in known:
        raise unknown(kind, name, known)
    return name
