"""`gemelo hold | resume | stop | reset | reference`: what a person may ask of the device besides motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.device import DeviceCommandKind, DeviceCommandRequest
from schemas.topics import DEVICE_COMMAND
from services.cli.exits import CommandError, ExitCode
from services.cli.units import parse_joints, show

if TYPE_CHECKING:
    from services.arm.description import Arm
    from services.cli.session import Session

TIMEOUT = 3.0  # [s]


def command(session: Session, kind: DeviceCommandKind) -> ExitCode:
    """Sends a command and says what the device answered."""
    return _send(session, DeviceCommandRequest(command=kind))


def reference(session: Session, assignments: Sequence[str]) -> ExitCode:
    """Declares where the joints stand now; those not named are at robot.toml's reference position."""
    request = reference_request(session.arm, assignments)
    code = _send(session, request)
    for name, position in zip(request.name, request.position, strict=True):
        print(f"  {name} is at {show(position, session.arm.joint(name).unit)}")
    return code


def reference_request(arm: Arm, assignments: Sequence[str]) -> DeviceCommandRequest:
    """The request with every joint named."""
    values = {joint.name: joint.drive.reference_position for joint in arm.joints}
    values.update(parse_joints(assignments, arm.joints))
    return DeviceCommandRequest(
        command=DeviceCommandKind.REFERENCE, name=tuple(values), position=tuple(values.values())
    )


def _send(session: Session, request: DeviceCommandRequest) -> ExitCode:
    answer = session.node.call(DEVICE_COMMAND, request, timeout=TIMEOUT)
    what = request.command.name.lower()
    if not answer.accepted:
        raise CommandError(f"{what} refused: {answer.reason} (device mode {answer.mode.name})")
    print(f"{what} done: device mode {answer.mode.name}")
    return ExitCode.OK
