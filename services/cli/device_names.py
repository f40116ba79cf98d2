"""The names that robot.toml gives to the device's parts, as a person writes them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from services.cli.exits import CommandError, usage
from services.cli.names import unknown

if TYPE_CHECKING:
    from schemas.robot import Input, Output, Sensor
    from services.arm.description import Arm, Joint


def joint_of(arm: Arm, name: str) -> Joint:
    """The joint of that name; its name on the wire will do too."""
    for joint in arm.joints:
        if name in (joint.name, joint.wire_name):
            return joint
    raise unknown("joint", name, arm.joint_names)


def joint_name(arm: Arm, name: str) -> str:
    """The joint's name for what the device calls it; any other text is left as it is."""
    return next((joint.name for joint in arm.joints if name in (joint.name, joint.wire_name)), name)


def require_name(kind: str, name: str, parts: Sequence[Input] | Sequence[Output] | Sequence[Sensor]) -> str:
    """`name`, if robot.toml has such a part."""
    known = [part.name for part in parts]
    if not known:
        raise usage(f"robot.toml has no [[{kind}]], so there is none to name")
    if name not in known:
        raise unknown(kind, name, known)
    return name


def homing_joints(arm: Arm, names: Iterable[str]) -> list[Joint]:
    """The joints to home: those named, or all that have a home switch; raises with the remedy for others."""
    asked = [joint_of(arm, name) for name in names]
    without = [joint.name for joint in asked if joint.drive.homing is None]
    if without:
        raise CommandError(
            f'joint "{without[0]}" has no [joint.homing] in robot.toml, so it cannot home: '
            f"declare where it stands, `gemelo reference --joints {without[0]}=...`"
        )
    found = asked or [joint for joint in arm.joints if joint.drive.homing is not None]
    if not found:
        raise CommandError(
            "no joint has a [joint.homing] in robot.toml: declare where they stand with `gemelo reference`"
        )
    return found
