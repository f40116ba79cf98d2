"""What a person may ask of the device besides a motion: from `gemelo hold` to `gemelo speed`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.device import DeviceCommandKind, DeviceCommandRequest, DeviceCommandResponse
from schemas.topics import DEVICE_COMMAND
from services.cli.device_names import require_name
from services.cli.exits import CommandError, ExitCode, usage
from services.cli.units import parse_joints, show

if TYPE_CHECKING:
    from services.arm.description import Arm
    from services.cli.session import Session

TIMEOUT = 3.0  # [s]
AFTERWARDS = {
    DeviceCommandKind.ARM: "the motors hold; `gemelo home` or `gemelo reference` if a joint is unreferenced",
    DeviceCommandKind.DISARM: "the motors are without current, and every joint is unreferenced",
}


def command(session: Session, kind: DeviceCommandKind) -> ExitCode:
    """Sends a command and says what the device answered."""
    code = _send(session, DeviceCommandRequest(command=kind))
    if kind is DeviceCommandKind.ARM:
        wait_for_drivers(session)
    if kind in AFTERWARDS:
        print(f"  {AFTERWARDS[kind]}")
    return code


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


def output(session: Session, name: str, is_on: bool) -> ExitCode:
    """Switches an output of robot.toml."""
    require_name("output", name, session.arm.outputs)
    return _send(
        session,
        DeviceCommandRequest(command=DeviceCommandKind.OUTPUT, output=name, value=float(is_on)),
        f"output {name} {'on' if is_on else 'off'}",
    )


def speed(session: Session, percent: float) -> ExitCode:
    """How fast the device plays every path from now on [%]."""
    request = DeviceCommandRequest(command=DeviceCommandKind.SPEED, value=share_of(percent))
    return _send(session, request, f"speed {percent:g} %")


def share_of(percent: float) -> float:
    """The time scale, 0 to 1."""
    if not 0.0 <= percent <= 100.0:
        raise usage(f"a speed of {percent:g} % is not in 0 to 100: the planner's own speed is 100")
    return percent / 100.0


def ask(session: Session, request: DeviceCommandRequest, what: str = "") -> DeviceCommandResponse:
    """The device's answer; a no is raised with its reason."""
    answer = session.node.call(DEVICE_COMMAND, request, timeout=TIMEOUT)
    if not answer.accepted:
        what = what or request.command.name.lower()
        mode = f" (device mode {answer.mode.name})" if f"mode {answer.mode.name}" not in answer.reason else ""
        raise CommandError(f"{what} refused: {answer.reason}{mode}")
    return answer


def wait_for_drivers(session: Session) -> None:
    """Until drivers that were just energised take steps: the next command may be a homing."""
    session.node.wait(max(joint.driver.enable_lead_ms for joint in session.arm.joints) * 1e-3)


def _send(session: Session, request: DeviceCommandRequest, what: str = "") -> ExitCode:
    what = what or request.command.name.lower()
    print(f"{what} done: device mode {ask(session, request, what).mode.name}")
    return ExitCode.OK
