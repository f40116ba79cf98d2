"""A person's command as the wire says it: names become masks and indices, units become steps."""

from __future__ import annotations

from gemelo.libraries.arm.errors import suggestion
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.device import (
    ArmCommand,
    DeviceCommand,
    DeviceCommandKind,
    DeviceCommandRequest,
    HomeCommand,
    OutputCommand,
    ReferenceCommand,
    ResetCommand,
    ResumeCommand,
    SpeedCommand,
    StopKind,
)
from gemelo.services.stepper_gateway.device.pending_commands import NO_ARGUMENTS, Arguments
from gemelo.services.stepper_gateway.goals.limit_checks import SLACK, beyond
from gemelo.services.stepper_gateway.goals.rejections import invalid
from gemelo.services.stepper_gateway.goals.trajectory_checks import require_known

KINDS: dict[type[DeviceCommand], DeviceCommandKind] = {
    ResumeCommand: DeviceCommandKind.RESUME,
    ResetCommand: DeviceCommandKind.RESET,
    ReferenceCommand: DeviceCommandKind.REFERENCE,
    ArmCommand: DeviceCommandKind.ARM,
    HomeCommand: DeviceCommandKind.HOME,
    OutputCommand: DeviceCommandKind.OUTPUT,
    SpeedCommand: DeviceCommandKind.SPEED,
}
STOPS = {
    StopKind.STOP: DeviceCommandKind.STOP,
    StopKind.HOLD: DeviceCommandKind.HOLD,
    StopKind.DISARM: DeviceCommandKind.DISARM,
}


def kind_of(request: DeviceCommandRequest) -> DeviceCommandKind:
    """The number that the command has on the wire."""
    return KINDS[type(request.command)]


def arguments_of(request: DeviceCommandRequest, arm: ArmDescription) -> Arguments:
    """Raises `GoalRejected` for a name, position or value that the arm does not have."""
    match request.command:
        case ReferenceCommand() as command:
            return _reference(command, arm)
        case HomeCommand() as command:
            return Arguments(argument=_homing_mask(command.name, arm))
        case OutputCommand() as command:
            return _output(command, arm)
        case SpeedCommand() as command:
            return Arguments(argument=_permil(command.scale))
        case _:
            return NO_ARGUMENTS


def _reference(command: ReferenceCommand, arm: ArmDescription) -> Arguments:
    """Where the joints named stand, by the command or else by robot.toml; all of them if none is named."""
    if command.position and len(command.position) != len(command.name):
        raise invalid(f"{len(command.name)} joints are named and {len(command.position)} positions given")
    require_known(command.name, arm.joints)
    positions = {joint.name: joint.drive.reference_position for joint in arm.joints}
    positions |= dict(zip(command.name, command.position, strict=False))
    for joint in arm.joints:
        _require_within(joint, positions[joint.name])
    steps = tuple(joint.steps.to_q8(positions[joint.name]) for joint in arm.joints)
    return Arguments(positions=steps, argument=_mask(command.name, arm))


def _require_within(joint: Joint, position: float) -> None:
    if not joint.lower - SLACK <= position <= joint.upper + SLACK:
        raise invalid(beyond(joint, position))


def _homing_mask(names: tuple[str, ...], arm: ArmDescription) -> int:
    require_known(names, arm.joints)
    asked = [joint for joint in arm.joints if not names or joint.name in names]
    able = [joint.name for joint in asked if joint.drive.homing is not None]
    for joint in asked:
        if joint.name not in able and (names or not able):
            raise invalid(
                f'joint "{joint.name}" has no home switch: put it into place by hand and run `gemelo reference`, or '
                "give it a [joint.homing] in robot.toml"
            )
    return _mask(names, arm)


def _output(command: OutputCommand, arm: ArmDescription) -> Arguments:
    names = [output.name for output in arm.outputs]
    if command.output not in names:
        raise invalid(f'{arm.name} has no output "{command.output}"{suggestion(command.output, names)}')
    return Arguments(index=names.index(command.output), argument=int(command.on))


def _permil(speed: float) -> int:
    if not 0.0 <= speed <= 1.0:
        raise invalid(f"a speed is 0 (stands) to 1 (as planned), not {speed:g}")
    return round(speed * 1000.0)


def _mask(names: tuple[str, ...], arm: ArmDescription) -> int:
    """Bit j for joint j; 0, which means all, for no names."""
    return sum(1 << index for index, joint in enumerate(arm.joints) if joint.name in names)
