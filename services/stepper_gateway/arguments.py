"""A person's command as the wire says it: names become masks and indices, units become steps."""

from __future__ import annotations

from schemas.device import DeviceCommandKind, DeviceCommandRequest
from services.arm.description import Arm, Joint
from services.arm.errors import suggestion
from services.stepper_gateway.commands import NO_ARGUMENTS, Arguments
from services.stepper_gateway.goal_limits import SLACK, beyond
from services.stepper_gateway.goal_shape import require_known
from services.stepper_gateway.refusals import invalid


def arguments_of(request: DeviceCommandRequest, arm: Arm) -> Arguments:
    """Raises `GoalRejected` for a name, position or value that the arm does not have."""
    match request.command:
        case DeviceCommandKind.REFERENCE:
            return _reference(request, arm)
        case DeviceCommandKind.HOME:
            return Arguments(argument=_homing_mask(request, arm))
        case DeviceCommandKind.OUTPUT:
            return _output(request, arm)
        case DeviceCommandKind.SPEED:
            return Arguments(argument=_permil(request.value))
        case _:
            return NO_ARGUMENTS


def _reference(request: DeviceCommandRequest, arm: Arm) -> Arguments:
    """Where the joints named stand, by the request or else by robot.toml; all of them if none is named."""
    if request.position and len(request.position) != len(request.name):
        raise invalid(f"{len(request.name)} joints are named and {len(request.position)} positions given")
    require_known(request.name, arm.joints)
    positions = {joint.name: joint.drive.reference_position for joint in arm.joints}
    positions |= dict(zip(request.name, request.position, strict=False))
    for joint in arm.joints:
        _require_within(joint, positions[joint.name])
    steps = tuple(joint.steps.to_q8(positions[joint.name]) for joint in arm.joints)
    return Arguments(positions=steps, argument=_mask(request.name, arm))


def _require_within(joint: Joint, position: float) -> None:
    if not joint.lower - SLACK <= position <= joint.upper + SLACK:
        raise invalid(beyond(joint, position))


def _homing_mask(request: DeviceCommandRequest, arm: Arm) -> int:
    require_known(request.name, arm.joints)
    asked = [joint for joint in arm.joints if not request.name or joint.name in request.name]
    able = [joint.name for joint in asked if joint.drive.homing is not None]
    for joint in asked:
        if joint.name not in able and (request.name or not able):
            raise invalid(
                f'joint "{joint.name}" has no home switch: put it into place by hand and run `gemelo reference`, or '
                "give it a [joint.homing] in robot.toml"
            )
    return _mask(request.name, arm)


def _output(request: DeviceCommandRequest, arm: Arm) -> Arguments:
    names = [output.name for output in arm.outputs]
    if request.output not in names:
        raise invalid(f'{arm.name} has no output "{request.output}"{suggestion(request.output, names)}')
    if request.value not in (0.0, 1.0):
        raise invalid(f'output "{request.output}" is 0 (off) or 1 (on), not {request.value:g}')
    return Arguments(index=names.index(request.output), argument=int(request.value))


def _permil(speed: float) -> int:
    if not 0.0 <= speed <= 1.0:
        raise invalid(f"a speed is 0 (stands) to 1 (as planned), not {speed:g}")
    return round(speed * 1000.0)


def _mask(names: tuple[str, ...], arm: Arm) -> int:
    """Bit j for joint j; 0, which means all, for no names."""
    return sum(1 << index for index, joint in enumerate(arm.joints) if joint.name in names)
