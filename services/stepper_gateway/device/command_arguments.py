"""A person's command as the wire says it: names become masks and indices, units become steps."""

from __future__ import annotations

from gemelo.libraries.arm.errors import nearest
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
from gemelo.schemas.reasons import because
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
        named, given = len(command.name), len(command.position)
        raise invalid(because("command.positions.count", named=named, given=given))
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
            raise invalid(because("command.home.no_switch", joint=joint.name))
    return _mask(names, arm)


def _output(command: OutputCommand, arm: ArmDescription) -> Arguments:
    names = [output.name for output in arm.outputs]
    if command.output not in names:
        guess = nearest(command.output, names)
        raise invalid(because("command.output.unknown", guess, robot=arm.name, output=command.output))
    return Arguments(index=names.index(command.output), argument=int(command.on))


def _permil(speed: float) -> int:
    if not 0.0 <= speed <= 1.0:
        raise invalid(because("command.speed.range", value=speed))
    return round(speed * 1000.0)


def _mask(names: tuple[str, ...], arm: ArmDescription) -> int:
    """Bit j for joint j; 0, which means all, for no names."""
    return sum(1 << index for index, joint in enumerate(arm.joints) if joint.name in names)
