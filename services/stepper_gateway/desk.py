"""The desk for device commands: a person's, each with an answer, and the gateway's own STOPs."""

from __future__ import annotations

from schemas.device import DeviceCommandKind, DeviceCommandRequest, DeviceCommandResponse, DeviceMode
from services.stepper_gateway.commands import INTERNAL, PendingCommand
from services.stepper_gateway.goal_limits import SLACK, beyond
from services.stepper_gateway.goal_shape import require_names
from services.stepper_gateway.links.frames import Code, CommandReply, encode
from services.stepper_gateway.links.link import Kind
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.mover import Mover
from services.stepper_gateway.outputs import CommandAnswer
from services.stepper_gateway.refusals import GoalRejected, invalid
from services.stepper_gateway.reporting import code_name

REMEDIES = {
    Code.NOT_READY: "it does not do that in this mode",
    Code.POSITION_LIMIT: "the position is beyond its soft limits",
}


class CommandDesk:
    """Takes commands, has them sent until the device answers, and hands the answers out."""

    def __init__(self, mover: Mover) -> None:
        self._mover = mover

    def ask(self, request: DeviceCommandRequest, ticket: int, moment: Moment) -> bool:
        """Have it sent, or answer at once why not; true if it will be sent."""
        mover = self._mover
        try:
            if reason := mover.session.absence(moment, mover.parameters.state_timeout):
                raise invalid(reason)
            positions = self._reference(request)
        except GoalRejected as rejected:
            self._answer(ticket, False, rejected.reason)
            return False
        mover.commands.ask(request.command, moment, mover.parameters.command_timeout, ticket, positions)
        return True

    def on_reply(self, reply: CommandReply, moment: Moment) -> None:
        """The device has answered a command."""
        if reply.boot_id != self._mover.session.boot_id or reply.code == Code.EXPIRED:
            return
        command = self._mover.commands.answered(reply)
        if command is None:
            return
        accepted = reply.code in (Code.OK, Code.DUPLICATE)
        if accepted:
            self._note(command, reply)
        if command.ticket != INTERNAL:
            self._answer(command.ticket, accepted, "" if accepted else self._complaint(command, reply), reply.mode)
        elif not accepted:
            self._mover.event("command_refused", self._complaint(command, reply), moment)

    def send_due(self, moment: Moment) -> None:
        """Send what is new or was not answered."""
        mover = self._mover
        if mover.session.absence(moment, mover.parameters.state_timeout):
            return
        for frame in mover.commands.due(moment, mover.session.clock, mover.session.boot_id):
            mover.out.send(Kind.CMD, encode(frame))

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time; a STOP of our own is asked for again."""
        for command in self._mover.commands.expired(moment):
            state = self._mover.state
            if command.kind == DeviceCommandKind.HOLD and state is not None:
                self._mover.hold_answered(state.mode == DeviceMode.HOLD, state.t_us)
            if command.ticket != INTERNAL:
                self._answer(command.ticket, False, f"the device has not answered {command.kind.name} in time")
            elif command.kind == DeviceCommandKind.STOP:
                self._mover.stop(moment)
        self.send_due(moment)

    def give_up(self, reason: str) -> None:
        """The device these commands were for is gone."""
        for command in self._mover.commands.drop_all():
            if command.ticket != INTERNAL:
                self._answer(command.ticket, False, reason)

    def _note(self, command: PendingCommand, reply: CommandReply) -> None:
        match command.kind:
            case DeviceCommandKind.STOP:
                self._mover.stop_answered(reply.t_us)
            case DeviceCommandKind.HOLD:
                self._mover.hold_answered(reply.mode == DeviceMode.HOLD, reply.t_us)
            case DeviceCommandKind.REFERENCE:
                self._mover.transmission.forget()

    def _reference(self, request: DeviceCommandRequest) -> tuple[int, ...]:
        """[1/256 step] of REFERENCE: what the request says, else the arm's reference pose; raises `GoalRejected`."""
        if request.command != DeviceCommandKind.REFERENCE:
            return ()
        joints = self._mover.joints
        if not request.name and not request.position:
            return tuple(joint.steps.to_q8(joint.drive.reference_position) for joint in joints)
        require_names(request.name, joints)
        if len(request.position) != len(request.name):
            raise invalid(f"{len(request.name)} joints are named and {len(request.position)} positions given")
        positions = dict(zip(request.name, request.position, strict=True))
        for joint in joints:
            if not joint.lower - SLACK <= positions[joint.name] <= joint.upper + SLACK:
                raise invalid(beyond(joint, positions[joint.name]))
        return tuple(joint.steps.to_q8(positions[joint.name]) for joint in joints)

    def _complaint(self, command: PendingCommand, reply: CommandReply) -> str:
        remedy = REMEDIES.get(Code(reply.code)) if reply.code in Code._value2member_map_ else None
        mode = DeviceMode(reply.mode).name if reply.mode in DeviceMode._value2member_map_ else str(reply.mode)
        text = f"the device refuses {command.kind.name} in mode {mode}: {code_name(reply.code)}"
        return f"{text}, {remedy}" if remedy else text

    def _answer(self, ticket: int, accepted: bool, reason: str, mode: int | None = None) -> None:
        said = mode is not None and mode in DeviceMode._value2member_map_
        known = DeviceMode(mode or 0) if said else self._mover.session.mode
        response = DeviceCommandResponse(accepted=accepted, reason=reason, mode=known)
        self._mover.out.put(CommandAnswer(ticket, response))
