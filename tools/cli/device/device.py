"""The commands that the device obeys at once: hold, resume, stop, reset, arm, disarm, reference, output, speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import gemelo
from gemelo.api.errors import why_of
from gemelo.schemas.device import (
    ArmCommand,
    DeviceCommand,
    OutputCommand,
    ReferenceCommand,
    ResetCommand,
    ResumeCommand,
    SpeedCommand,
    StopKind,
)
from gemelo.schemas.reasons import because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, require_name, usage
from gemelo.tools.cli.common.language import sentence
from gemelo.tools.cli.common.session import connect_arm, load_robot
from gemelo.tools.cli.common.units import parse_joints, share, show
from gemelo.tools.cli.parser import Choices, Options, Parser

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.libraries.arm.model.description import ArmDescription

BY_NAME: dict[str, DeviceCommand | StopKind] = {
    "arm": ArmCommand(),
    "reset": ResetCommand(),
    "resume": ResumeCommand(),
    "stop": StopKind.STOP,
    "hold": StopKind.HOLD,
    "disarm": StopKind.DISARM,
}
AFTERWARDS = {"arm": because("cli.device.armed"), "disarm": because("cli.device.disarmed")}  # what is so then


def stop_options(parser: Parser) -> None:
    """Adds --ready."""
    parser.add_argument(
        "--ready", action="store_true", help="connect now, and stop the arm on each Enter or space; q leaves"
    )


def run_stop(options: Options) -> ExitCode:
    """Stops the arm, now or at each key."""
    if options.ready:
        from gemelo.tools.cli.motion.stop_ready import wait_ready  # for this one alone

        with connect_arm() as arm:
            return wait_ready(arm)
    return run(options)


def run(options: Options) -> ExitCode:
    """Sends the command that the last word names."""
    with connect_arm() as arm:
        return command(arm, options.command.words[-1])


def reference_options(parser: Parser) -> None:
    """Adds the joints' positions."""
    parser.add_argument(
        "--joints", nargs="+", default=[], metavar="JOINT=VALUE", help="where they stand, as 30deg or 40mm"
    )


def reference_choices(robot: Robot | None) -> Choices:
    """The joints, after --joints."""
    return {} if robot is None else {"--joints": [f"{joint.name}=" for joint in robot.description.joints]}


def run_reference(options: Options) -> ExitCode:
    """Declares where the joints stand."""
    with connect_arm() as arm:
        return reference(arm, options.joints)


def output_options(parser: Parser) -> None:
    """Adds the output and its state."""
    parser.add_argument("output", metavar="OUTPUT", help="a name of robot.toml's [[output]]")
    parser.add_argument("state", choices=("on", "off"), help="on or off")


def run_output(options: Options) -> ExitCode:
    """Switches an output; a wrong name is refused before the stack is asked."""
    robot = load_robot()
    require_name("output", options.output, robot.description.outputs)
    with connect_arm(robot) as arm:
        return output(arm, options.output, options.state == "on")


def output_choices(robot: Robot | None) -> Choices:
    """The outputs, then on and off."""
    names = [output.name for output in robot.description.outputs] if robot else []
    return {"": names, **dict.fromkeys(names, ("on", "off"))}


def speed_options(parser: Parser) -> None:
    """Adds the speed."""
    parser.add_argument("share", metavar="SHARE", type=share, help="of the planned speed, 0%% to 100%%")


def run_speed(options: Options) -> ExitCode:
    """Sets the speed; one that is out of range is refused before the stack is asked."""
    require_share(options.share)
    with connect_arm() as arm:
        return speed(arm, options.share)


def command(arm: Arm, name: str) -> ExitCode:
    """Sends a command of `BY_NAME` and prints the device's answer; raises `CommandError` if it refuses."""
    code = send(arm, BY_NAME[name])
    if name in AFTERWARDS:
        print(f"  {sentence(AFTERWARDS[name])}")
    return code


def reference(arm: Arm, assignments: Sequence[str]) -> ExitCode:
    """Declares where the joints stand now; those not named stand at robot.toml's reference position."""
    request = reference_request(arm.description, assignments)
    code = send(arm, request)
    for name, position in zip(request.name, request.position, strict=True):
        place = show(position, arm.description.joint(name).unit)
        print(f"  {sentence(because('cli.device.joint_at', joint=name, place=place))}")
    return code


def reference_request(arm: ArmDescription, assignments: Sequence[str]) -> ReferenceCommand:
    """The command with every joint named."""
    from gemelo.api.device import reference_command  # slow to load: half of `gemelo`

    return reference_command(arm, parse_joints(assignments, arm.joints))


def output(arm: Arm, name: str, is_on: bool) -> ExitCode:
    """Switches the output `name` of robot.toml."""
    require_name("output", name, arm.description.outputs)
    return send(arm, OutputCommand(output=name, on=is_on), f"output {name} {'on' if is_on else 'off'}")


def speed(arm: Arm, scale: float) -> ExitCode:
    """Sets how fast the device plays every path from now on: the time scale, 0 to 1."""
    return send(arm, SpeedCommand(scale=require_share(scale)), f"speed {100.0 * scale:g} %")


def require_share(scale: float) -> float:
    """Returns the time scale; raises `CommandError` outside of 0 to 1."""
    if not 0.0 <= scale <= 1.0:
        raise usage(because("cli.speed.range", speed=scale))
    return scale


def send(arm: Arm, wanted: DeviceCommand | StopKind, what: str = "") -> ExitCode:
    """Sends what is `wanted` and prints the device's answer; raises `CommandError` with its reason if it refuses."""
    try:
        answer = arm.device.send(wanted, what)
    except gemelo.Refused as error:
        raise CommandError(error) from error
    what = what or (wanted.value if isinstance(wanted, StopKind) else str(wanted.__struct_config__.tag))
    done = because("cli.device.done", what=what, mode=answer.mode.name)
    print(sentence(because("cli.device.done.but", done, why_of(answer)) if answer.reason else done))
    return ExitCode.OK
