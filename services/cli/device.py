"""The commands that the device obeys at once: hold, resume, stop, reset, arm, disarm, reference, output, speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.device import (
    ArmCommand,
    DeviceCommand,
    DeviceCommandRequest,
    DeviceCommandResponse,
    DeviceStopRequest,
    OutputCommand,
    ReferenceCommand,
    ResetCommand,
    ResumeCommand,
    SpeedCommand,
    StopKind,
)
from schemas.topics import DEVICE_COMMAND, DEVICE_STOP
from services.cli.errors import CommandError, ExitCode, usage
from services.cli.parser import Choices, Options, Parser
from services.cli.robot_names import require_name
from services.cli.session import Robot, Session, connect, load_robot
from services.cli.units import parse_joints, share, show

if TYPE_CHECKING:
    from services.arm.model.description import Arm

TIMEOUT = 3.0  # [s]
BY_NAME: dict[str, DeviceCommand | StopKind] = {
    "arm": ArmCommand(),
    "reset": ResetCommand(),
    "resume": ResumeCommand(),
    "stop": StopKind.STOP,
    "hold": StopKind.HOLD,
    "disarm": StopKind.DISARM,
}
AFTERWARDS: dict[str, str] = {
    "arm": "the motors hold; `gemelo home` or `gemelo reference` if a joint is unreferenced",
    "disarm": "the motors are without current, and every joint is unreferenced",
}


def run(options: Options) -> ExitCode:
    """Sends the command that the last word names."""
    with connect() as session:
        return command(session, options.command.words[-1])


def reference_options(parser: Parser) -> None:
    """Adds the joints' positions."""
    parser.add_argument(
        "--joints", nargs="+", default=[], metavar="JOINT=VALUE", help="where they stand, as 30deg or 40mm"
    )


def reference_choices(robot: Robot | None) -> Choices:
    """The joints, after --joints."""
    return {} if robot is None else {"--joints": [f"{joint.name}=" for joint in robot.arm.joints]}


def run_reference(options: Options) -> ExitCode:
    """Declares where the joints stand."""
    with connect() as session:
        return reference(session, options.joints)


def output_options(parser: Parser) -> None:
    """Adds the output and its state."""
    parser.add_argument("output", metavar="OUTPUT", help="a name of robot.toml's [[output]]")
    parser.add_argument("state", choices=("on", "off"), help="on or off")


def run_output(options: Options) -> ExitCode:
    """Switches an output; a wrong name is refused before the stack is asked."""
    robot = load_robot()
    require_name("output", options.output, robot.arm.outputs)
    with connect(robot) as session:
        return output(session, options.output, options.state == "on")


def output_choices(robot: Robot | None) -> Choices:
    """The outputs, then on and off."""
    names = [output.name for output in robot.arm.outputs] if robot else []
    return {"": names, **dict.fromkeys(names, ("on", "off"))}


def speed_options(parser: Parser) -> None:
    """Adds the speed."""
    parser.add_argument("share", metavar="SHARE", type=share, help="of the planned speed, 0%% to 100%%")


def run_speed(options: Options) -> ExitCode:
    """Sets the speed; one that is out of range is refused before the stack is asked."""
    require_share(options.share)
    with connect() as session:
        return speed(session, options.share)


def command(session: Session, name: str) -> ExitCode:
    """Sends a command of `BY_NAME` and prints the device's answer; raises `CommandError` if it refuses."""
    code = _send(session, BY_NAME[name])
    if name == "arm":
        wait_for_drivers(session)
    if name in AFTERWARDS:
        print(f"  {AFTERWARDS[name]}")
    return code


def reference(session: Session, assignments: Sequence[str]) -> ExitCode:
    """Declares where the joints stand now; those not named stand at robot.toml's reference position."""
    request = reference_request(session.arm, assignments)
    code = _send(session, request)
    for name, position in zip(request.name, request.position, strict=True):
        print(f"  {name} is at {show(position, session.arm.joint(name).unit)}")
    return code


def reference_request(arm: Arm, assignments: Sequence[str]) -> ReferenceCommand:
    """The command with every joint named."""
    values = {joint.name: joint.drive.reference_position for joint in arm.joints}
    values.update(parse_joints(assignments, arm.joints))
    return ReferenceCommand(name=tuple(values), position=tuple(values.values()))


def output(session: Session, name: str, is_on: bool) -> ExitCode:
    """Switches the output `name` of robot.toml."""
    require_name("output", name, session.arm.outputs)
    return _send(
        session,
        OutputCommand(output=name, on=is_on),
        f"output {name} {'on' if is_on else 'off'}",
    )


def speed(session: Session, scale: float) -> ExitCode:
    """Sets how fast the device plays every path from now on: the time scale, 0 to 1."""
    return _send(session, SpeedCommand(scale=require_share(scale)), f"speed {100.0 * scale:g} %")


def require_share(scale: float) -> float:
    """Returns the time scale; raises `CommandError` outside of 0 to 1."""
    if not 0.0 <= scale <= 1.0:
        raise usage(f"a speed of {100.0 * scale:g}% is not in 0% to 100%: the planner's own speed is 100%")
    return scale


def ask(session: Session, wanted: DeviceCommand | StopKind, what: str = "") -> DeviceCommandResponse:
    """Sends what is `wanted` and returns the answer; raises `CommandError` with the device's reason if it refuses."""
    if isinstance(wanted, StopKind):
        answer = session.node.call(DEVICE_STOP, DeviceStopRequest(kind=wanted), timeout=TIMEOUT)
    else:
        answer = session.node.call(DEVICE_COMMAND, DeviceCommandRequest(command=wanted), timeout=TIMEOUT)
    if not answer.accepted:
        mode = f" (device mode {answer.mode.name})" if f"mode {answer.mode.name}" not in answer.reason else ""
        raise CommandError(f"{what or _name(wanted)} refused: {answer.reason}{mode}")
    return answer


def wait_for_drivers(session: Session) -> None:
    """Waits until drivers that were just energised accept steps: the next command may be a homing."""
    session.node.wait(max(joint.driver.enable_lead_ms for joint in session.arm.joints) * 1e-3)


def _send(session: Session, wanted: DeviceCommand | StopKind, what: str = "") -> ExitCode:
    what = what or _name(wanted)
    answer = ask(session, wanted, what)
    print(f"{what} done: device mode {answer.mode.name}{f'; {answer.reason}' if answer.reason else ''}")
    return ExitCode.OK


def _name(wanted: DeviceCommand | StopKind) -> str:
    return wanted.value if isinstance(wanted, StopKind) else str(wanted.__struct_config__.tag)
