"""The desk for device commands: a person's, each with an answer, and the gateway's own STOPs."""

from __future__ import annotations

from schemas.device import DeviceCommandKind, DeviceCommandRequest, DeviceCommandResponse, DeviceMode
from services.stepper_gateway.arguments import arguments_of
from services.stepper_gateway.commands import INTERNAL, PendingCommand
from services.stepper_gateway.links.frames import Code, CommandReply, code_name, encode
from services.stepper_gateway.links.link import Kind
from services.stepper_gateway.moment import Moment
from services.stepper_gateway.mover import Mover
from services.stepper_gateway.outputs import Answer
from services.stepper_gateway.refusals import GoalRejected, invalid

REMEDIES: dict[int, str] = {
    Code.NOT_READY: "it does not do that in this mode",
    Code.POSITION_LIMIT: "the position is beyond its soft limits",
    Code.NOT_ARMED: "its drivers are off, or only just on: run `gemelo device arm`, and wait a second",
    Code.ESTOP_PRESSED: "its emergency stop is pressed: release it first",
    Code.NO_HOMING: "a joint has no home switch: give it a [joint.homing] in robot.toml, or run `gemelo reference`",
    Code.BAD_ARGUMENT: "it has no such output, joint or value: see `gemelo device config`",
}
NOT_NOW = {
    DeviceCommandKind.RESUME: "only a hold can be resumed; start a new goal",
    DeviceCommandKind.REFERENCE: "the arm must stand: run `gemelo stop`, or clear its fault with `gemelo reset`",
    DeviceCommandKind.HOME: "the arm must stand: run `gemelo stop`, or clear its fault with `gemelo reset`",
    DeviceCommandKind.DISARM: "the arm must stand: run `gemelo stop` first",
    DeviceCommandKind.ARM: "clear its fault or emergency stop with `gemelo reset` first",
}
TRUSTING = (  # commands that would move or mean something else with another configuration
    DeviceCommandKind.RESUME,
    DeviceCommandKind.REFERENCE,
    DeviceCommandKind.ARM,
    DeviceCommandKind.HOME,
    DeviceCommandKind.OUTPUT,
)
AT_REST = (DeviceCommandKind.REFERENCE, DeviceCommandKind.DISARM, DeviceCommandKind.HOME)  # steps count anew after them


class CommandDesk:
    """Takes commands, has them sent until the device answers, and hands the answers out."""

    def __init__(self, mover: Mover) -> None:
        self._mover = mover

    def ask(self, request: DeviceCommandRequest, ticket: int, goal_is_active: bool, moment: Moment) -> bool:
        """Have it sent, or answer at once why not; true if it will be sent."""
        mover = self._mover
        try:
            if reason := mover.absence(moment) or self._objection(request.command, goal_is_active):
                raise invalid(reason)
            arguments = arguments_of(request, mover.arm)
        except GoalRejected as rejected:
            self._answer(ticket, False, rejected.reason)
            return False
        mover.commands.ask(request.command, moment, mover.parameters.command_timeout, ticket, arguments)
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
        if mover.absence(moment):
            return
        for frame in mover.commands.due(moment, mover.session.clock, mover.session.boot_id):
            mover.out.send(Kind.CMD, encode(frame))

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time; a STOP of our own is asked for again."""
        for command in self._mover.commands.expired(moment):
            state = self._mover.session.latest
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

    def _objection(self, kind: DeviceCommandKind, goal_is_active: bool) -> str:
        if goal_is_active and kind in AT_REST:
            return f"a goal is being carried out: cancel it or run `gemelo stop` before {kind.name}"
        return self._mover.configuration.objection() if kind in TRUSTING else ""

    def _note(self, command: PendingCommand, reply: CommandReply) -> None:
        match command.kind:
            case DeviceCommandKind.STOP:
                self._mover.stop_answered(reply.t_us)
            case DeviceCommandKind.HOLD:
                self._mover.hold_answered(reply.mode == DeviceMode.HOLD, reply.t_us)
            case kind if kind in AT_REST:
                self._mover.transmission.forget()

    def _complaint(self, command: PendingCommand, reply: CommandReply) -> str:
        remedy = REMEDIES.get(reply.code)
        if reply.code == Code.NOT_READY:
            remedy = NOT_NOW.get(command.kind, remedy)
        mode = DeviceMode(reply.mode).name if reply.mode in DeviceMode._value2member_map_ else str(reply.mode)
        text = f"the device refuses {command.kind.name} in mode {mode}: {code_name(reply.code)}"
        return f"{text}, {remedy}" if remedy else text

    def _answer(self, ticket: int, accepted: bool, reason: str, mode: int | None = None) -> None:
        said = mode is not None and mode in DeviceMode._value2member_map_
        known = DeviceMode(mode or 0) if said else self._mover.session.mode
        response = DeviceCommandResponse(accepted=accepted, reason=reason, mode=known)
        self._mover.out.put(Answer(ticket, response))
